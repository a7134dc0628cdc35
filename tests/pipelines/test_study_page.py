"""The page of studies: one file, every point with its picture, and what a browser makes of it."""

import base64
import io
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pipelines.studies import page, record, run
from pipelines.studies.answer import Shot
from pipelines.studies.subjects import Setting
from tests.pipelines.test_study_form import GREY, example

VOID = {"meta", "img", "br", "link", "path", "use", "rect", "line", "circle", "input"}
BROWSER = next((p for n in ("chromium", "google-chrome") if (p := shutil.which(n))), None)


class Page(HTMLParser):
    """What a page holds. outside : addresses that are not its own. points : by section."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.outside: list[str] = []
        self.points: dict[str, set[int]] = {}
        self.data: dict[str, dict] = {}
        self.section, self.json = "", False
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        if tag not in VOID:
            self.open.append(tag)
        if "id" in found:
            self.ids.append(str(found["id"]))
        if tag == "section":
            self.section = str(found["id"])
        for name in ("src", "href", "data", "action", "srcset"):
            value = found.get(name) or "#"
            if not value.startswith(("#", "data:")):
                self.outside.append(value)
        if "data-point" in found:
            self.points.setdefault(self.section, set()).add(int(str(found["data-point"])))
        self.json = found.get("type") == "application/json"

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.json:
            self.data[self.section] = json.loads(data)
            self.json = False


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of two answers, as a run puts it together."""
    out = tmp_path_factory.mktemp("studies")
    for name in ("packing", "harmonics"):
        record.write(example(name), out, Setting(quick=True), 1.0, asked=f"How is {name}?")
    found = run.together(out)
    assert found == out / "index.html"
    return found


def test_page_is_well_formed_and_loads_nothing(written: Path) -> None:
    text = written.read_text(encoding="utf-8")
    found = Page(text)
    assert found.open == []
    assert found.outside == []
    assert len(found.ids) == len(set(found.ids))
    assert not re.search(r"@import|url\((?!['\"]?(#|data:))", text)
    assert not re.search(r"(?<!xmlns=\")https?://", text)


def test_every_point_has_its_picture_truth_and_difference(written: Path) -> None:
    found = Page(written.read_text(encoding="utf-8"))
    assert set(found.points) == set(found.data) == {"packing", "harmonics"}
    for name, data in found.data.items():
        assert found.points[name] == set(range(len(data["points"])))
        for each in data["points"]:
            for kind in ("picture", "truth", "difference"):
                raw = base64.b64decode(data["images"][each[kind]].split(",", 1)[1])
                assert Image.open(io.BytesIO(raw)).size == GREY.shape[1::-1]
    assert data["points"][2]["told"].endswith("the default")


def test_titles_and_questions_are_text(written: Path) -> None:
    text = written.read_text(encoding="utf-8")
    assert "<h2>c is best &lt;b&gt;</h2>" in text
    assert "How is packing?" in text
    assert 'href="#harmonics"' in text


def test_differences_are_about_grey_and_never_wrap() -> None:
    shot = Shot(GREY + np.uint8(3), GREY)
    assert np.all(page.difference(shot, 4) == 128 + 12)
    white = np.full_like(GREY, 255)
    assert np.all(page.difference(Shot(white, GREY), 8) == 255)
    assert np.all(page.difference(Shot(np.zeros_like(GREY), white), 8) == 0)


def test_gain_makes_small_differences_visible() -> None:
    shots = [Shot(GREY + np.uint8(n), GREY) for n in (3, 4, 5)]
    # 4 codes times 8 stay below 60, times 16 do not
    assert page.gain_of(shots) == 8
    assert page.gain_of([Shot(GREY, GREY)]) == max(page.GAINS)
    assert page.gain_of([Shot(GREY)]) == 1


def test_code_and_powers_are_set_and_nothing_else_is() -> None:
    assert page.marked("a < b & `c <d>`") == "a &lt; b &amp; <code>c &lt;d&gt;</code>"
    assert page.marked("g^h, 2^-7.5.") == "g<sup>h</sup>, 2<sup>-7.5</sup>."
    assert page.marked("a ` and ^ alone") == "a ` and ^ alone"


def test_large_pictures_are_shrunk() -> None:
    assert page.small(np.zeros((400, 100, 3), np.uint8)).shape == (192, 48, 3)
    assert page.small(GREY) is GREY


@pytest.mark.skipif(BROWSER is None, reason="no Chromium")
def test_a_browser_shows_the_default_and_no_errors(written: Path, tmp_path: Path) -> None:
    probe = tmp_path / "index.html"
    # What the arrow keys do is written where the dump of the page tells it
    probe.write_text(
        written.read_text(encoding="utf-8").replace(
            "</body>",
            """<script>
window.onerror = (message) => { document.body.dataset.error = message; };
const section = document.querySelector("section");
const first = section.querySelector('.point[tabindex="0"]');
first.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }));
document.body.dataset.after = section.dataset.shown;
const last = section.querySelector('.point[data-point="2"]').getBoundingClientRect();
section.querySelector(".chosen svg").dispatchEvent(new PointerEvent("pointermove",
  { clientX: last.x + last.width / 2 + 9, clientY: last.y, bubbles: true }));
document.body.dataset.near = section.dataset.shown;
document.body.dataset.shown = section.querySelector(".viewer .picture img").src.slice(0, 16);
document.body.dataset.wide = document.documentElement.scrollWidth;
</script></body>""",
        ),
        encoding="utf-8",
    )
    command = [str(BROWSER), "--headless=new", "--no-sandbox", "--disable-gpu", "--dump-dom"]
    command += [f"--user-data-dir={tmp_path}/profile", "--window-size=500,900"]
    done = subprocess.run(
        [*command, probe.as_uri()], capture_output=True, text=True, timeout=60, check=False
    )
    body = re.search(r"<body[^>]*>", done.stdout)
    assert body is not None, done.stderr[-2000:]
    assert "data-error" not in body[0]
    # Of three points by price the first was in focus, the arrow leads to the second
    assert 'data-after="1"' in body[0]
    # The pointer need not meet a mark, only come near
    assert 'data-near="2"' in body[0]
    assert 'data-shown="data:image/webp;"' in body[0]
    # Nothing is wider than the window of a phone
    assert int(re.search(r'data-wide="(\d+)"', body[0])[1]) <= 500
