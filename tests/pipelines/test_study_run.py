"""Running studies: what is kept, what goes on after an interruption, what is skipped and told."""

import json
import sys
from pathlib import Path
from types import ModuleType

import pytest

from formats.errors import InputError, MachineError
from pipelines.studies import kept, plots, run, subjects
from pipelines.studies.answer import Answer
from pipelines.studies.subjects import Setting
from tests.pipelines.test_study_form import example

NAMES = ("fake_mesh", "fake_voxels", "fake_third")


class Fakes:
    """Studies that count their runs. broken : raised by one of them, once."""

    def __init__(self) -> None:
        self.runs: list[str] = []
        self.broken: dict[str, BaseException] = {}

    def module(self, name: str, takes: tuple[str, ...]) -> ModuleType:
        def measure(setting: Setting) -> Answer:
            if name in self.broken:
                raise self.broken.pop(name)
            self.runs.append(name)
            return example(name)

        made = ModuleType(f"pipelines.studies.{name}", f"Is {name} well?\n\nMore.")
        made.measure, made.TAKES = measure, takes
        return made


@pytest.fixture
def fakes(monkeypatch: pytest.MonkeyPatch) -> Fakes:
    found = Fakes()
    for name, takes in zip(NAMES, (("mesh",), ("voxels",), ("mesh", "scene")), strict=True):
        monkeypatch.setitem(sys.modules, f"pipelines.studies.{name}", found.module(name, takes))
    monkeypatch.setattr(run, "QUESTIONS", NAMES)
    # Sources are bytes of any kind
    monkeypatch.setattr(subjects, "check", lambda source, kind: None)
    # Plots have tests of their own, and take a second each
    monkeypatch.setattr(plots, "draw", lambda answer, stem: [])
    monkeypatch.setattr(plots, "inline", lambda answer: iter(()))
    return found


def test_what_was_measured_is_kept(fakes: Fakes, tmp_path: Path) -> None:
    run.run((), tmp_path, quick=True, source=None)
    run.run((), tmp_path, quick=True, source=None)
    assert fakes.runs == list(NAMES)
    run.run(("fake_third",), tmp_path, quick=True, source=None, again=True)
    run.run(("fake_mesh",), tmp_path, quick=False, source=None)
    assert fakes.runs == [*NAMES, "fake_third", "fake_mesh"]


def test_an_interrupted_run_goes_on(fakes: Fakes, tmp_path: Path) -> None:
    fakes.broken["fake_voxels"] = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        run.run((), tmp_path, quick=True, source=None)
    assert fakes.runs == ["fake_mesh"]
    # What there is lies on the page
    assert "Is fake_mesh well?" in (tmp_path / "index.html").read_text()
    run.run((), tmp_path, quick=True, source=None)
    assert fakes.runs == list(NAMES)


def test_a_study_without_its_part_of_the_page_is_run_again(fakes: Fakes, tmp_path: Path) -> None:
    run.run(("fake_mesh",), tmp_path, quick=True, source=None)
    kept.part_of(tmp_path, "fake_mesh").unlink()
    run.run(("fake_mesh",), tmp_path, quick=True, source=None)
    assert fakes.runs == ["fake_mesh"] * 2


def test_what_one_study_refuses_does_not_stop_the_others(fakes: Fakes, tmp_path: Path) -> None:
    fakes.broken["fake_mesh"] = MachineError("OpenGL", "context", "none", "install a driver")
    with pytest.raises(MachineError):
        run.run((), tmp_path, quick=True, source=None)
    assert fakes.runs == list(NAMES[1:])


@pytest.mark.parametrize(
    ("name", "measured"),
    [
        ("a.glb", ["fake_mesh", "fake_third"]),
        ("a.VOX", ["fake_voxels"]),
        ("a.toml", ["fake_third"]),
        ("a.lp", []),
    ],
)
def test_a_source_goes_to_the_studies_that_take_it(
    fakes: Fakes,
    tmp_path: Path,
    name: str,
    measured: list[str],
    capsys: pytest.CaptureFixture[str],
) -> None:
    source = tmp_path / name
    source.write_bytes(b"any")
    run.run((), tmp_path / "out", quick=True, source=source, as_json=True)
    assert fakes.runs == measured
    told = json.loads(capsys.readouterr().out)
    assert told["measured"] == measured
    assert sorted([*told["skipped"], *measured]) == sorted(NAMES)
    assert all("takes" in why for why in told["skipped"].values())
    assert (told["page"] is None) == (not measured)


def test_json_says_machine_versions_seed_and_date(
    fakes: Fakes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run.run(("fake_mesh",), tmp_path, quick=True, source=None, as_json=True)
    told = json.loads(capsys.readouterr().out)
    assert {"machine", "cores", "versions", "load", "measured", "kept", "page"} <= set(told)
    assert set(told["answers"]["fake_mesh"]) >= {"answer", "seconds", "date", "seed", "quick"}
    data = json.loads((tmp_path / "fake_mesh.json").read_text())
    assert {"machine", "versions", "seed", "date", "key", "unit", "truth", "rows"} <= set(data)


def test_the_forecast_comes_from_earlier_runs(fakes: Fakes, tmp_path: Path) -> None:
    assert run.forecast(tmp_path, ["fake_mesh"], True).endswith("tell the time left")
    kept.note(tmp_path, "fake_mesh", True, 30.0)
    kept.note(tmp_path, "fake_third", True, 50.0)
    kept.note(tmp_path, "fake_third", False, 500.0)
    assert run.forecast(tmp_path, ["fake_mesh", "fake_third"], True) == ", about 80 s left"
    # One that is not known counts as the mean
    assert run.forecast(tmp_path, NAMES, True) == ", about 2 min left"


def test_a_broken_json_is_no_answer(fakes: Fakes, tmp_path: Path) -> None:
    tmp_path.joinpath("fake_mesh.json").write_text("{")
    run.run(("fake_mesh",), tmp_path, quick=True, source=None)
    assert fakes.runs == ["fake_mesh"]


def test_a_source_must_be_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        run.run((), tmp_path, quick=True, source=tmp_path / "none.vox")
    with pytest.raises(InputError, match="not a file"):
        run.run((), tmp_path, quick=True, source=tmp_path)


@pytest.mark.parametrize("name", ["a.glb", "a.obj", "a.VOX", "a.toml", "a.json", "a.lp", "a"])
@pytest.mark.parametrize("content", [b"", b"any"], ids=["empty", "damaged"])
def test_a_source_that_nothing_can_read_is_refused_once(
    tmp_path: Path, name: str, content: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / name
    source.write_bytes(content)
    with pytest.raises(InputError) as refusal:
        run.run((), tmp_path / "out", quick=True, source=source)
    assert refusal.value.file == str(source)
    assert capsys.readouterr().out == ""
    assert not (tmp_path / "out").exists()


def test_a_table_of_many_columns_fits_a_narrow_terminal() -> None:
    names = [f"column_{k}" for k in range(20)]
    cells = {"subject": ["a bust of stone"], "error_low": ["0.10"]}
    cells |= {name: ["12345"] for name in names}
    kept = run._fitting(cells, 78)
    # What others can do without goes first, then from the end; a column takes two more cells
    assert kept == ["subject", *names[:7]]
    assert sum(max(map(len, [*cells[n], *n.split("_")])) + 2 for n in kept) <= 78
    assert run._fitting(cells, 5) == ["subject"]
    assert run._fitting(cells, 1000) == list(cells)
