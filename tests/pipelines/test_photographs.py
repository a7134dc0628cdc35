"""`bakelight photographs` and `relight` of what it makes, as a user runs them."""

import json
from pathlib import Path

import numpy as np
import pytest

from formats.errors import InputError
from formats.files import exr, image
from pipelines import photographs, relit, single
from pipelines.cli import cli, run

single.add_to(cli)

SIZE, COUNT = 12, 20


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A matt bowl: each pixel a plane of its own, lit by Lambert's law."""
    folder = tmp_path / "set"
    folder.mkdir()
    x = (np.arange(SIZE) + 0.5) / SIZE - 0.5
    normal = np.stack([*np.meshgrid(x, -x), np.ones((SIZE, SIZE))], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    z = 0.3 + 0.7 * (np.arange(COUNT) + 0.5) / COUNT
    r, turn = np.sqrt(1 - z * z), 2.39996 * np.arange(COUNT)
    lines = [f"{COUNT}  "]
    for n, d in enumerate(np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1)):
        shade = np.maximum(normal @ d, 0)[..., None] * [0.8, 0.5, 0.3]
        image.write(folder / f"p{n}.png", shade)
        lines.append(f"C:\\set\\p{n}.png {d[0]} {d[1]} {d[2]}")
    (folder / "set.lp").write_bytes("\r\n".join(lines).encode())
    return folder / "set.lp"


def out_of(capfd: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Run a command that must succeed; return what it prints."""
    assert run([str(a) for a in arguments]) == 0
    return capfd.readouterr().out


def bake(source: Path, *more: object) -> list[object]:
    root = source.parents[1]
    return ["photographs", source, "-o", root / "dome", "--build", root / "build", *more]


def test_bake_and_relight(source: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "dome"
    text = out_of(capfd, *bake(source, "--hold-out", "every:5"))
    assert text.startswith("4 held-out lights: this ")
    assert "PTM (18 numbers)" in text
    out_of(capfd, "relight", out, "--light", "0,0,1", "-o", tmp_path / "front.exr")
    out_of(capfd, "relight", out, "--light", "0.3,0.4,0.8,1,2,3", "-o", tmp_path / "side.exr")
    both = ("--light", "0,0,1", "--light", "0.3,0.4,0.8,1,2,3")
    out_of(capfd, "relight", out, *both, "-o", tmp_path / "both.exr")
    front, side, sum_ = (
        exr.read(tmp_path / f"{name}.exr")["beauty"] for name in ("front", "side", "both")
    )
    # Half floats: 2^-11 of each of three values under 2
    np.testing.assert_allclose(sum_[..., :3], front[..., :3] + side[..., :3], atol=3 * 2.0**-11)
    # Lambert under irradiance pi is the albedo times the cosine, 1 in the middle
    np.testing.assert_allclose(front[5, 5, :3], [0.8, 0.5, 0.3], rtol=0.05)
    assert np.all(front[..., 3] == 1)
    again = json.loads(out_of(capfd, *bake(source, "--hold-out", "every:5", "--json")))
    assert again["hit"] is True
    assert again["quality"]["held_out_lights"] == 4


def test_inspect_is_short(source: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    out_of(capfd, *bake(source))
    text = out_of(capfd, "inspect", tmp_path / "dome")
    assert "leave_one_out_psnr" in text
    assert len(text) < 2000


def test_stored_values_are_shown_under_one_light(
    source: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "dome"
    text = out_of(capfd, *bake(source, "--space", "stored"))
    assert text.startswith("lights left out in turn: this ")
    direction = [float(v) for v in source.read_text().splitlines()[8].split()[1:]]
    light = relit.parse_light(",".join(map(str, direction)))
    picture = relit.relight(out, [light])
    truth = image.read(source.parent / "p7.png")
    # Measured: .034 where a corner turns away from the light, .0036 on average
    assert np.abs(picture[..., :3] - truth).max() < 0.05
    assert np.abs(picture[..., :3] - truth).mean() < 0.006
    dimmer = relit.relight(out, [(light[0], light[1] / 2)])
    np.testing.assert_allclose(dimmer[..., :3], picture[..., :3] / 2, rtol=1e-6)
    with pytest.raises(InputError, match="--space linear"):
        relit.relight(out, [light, light])


@pytest.mark.parametrize(
    ("text", "expected"),
    [("", ()), ("p3.png", (3,)), ("p19.png, p0.png,", (0, 19)), ("every:9", (0, 9, 18))],
)
def test_held_out_lights(source: Path, text: str, expected: tuple[int, ...]) -> None:
    assert photographs.held_out(source, text) == expected


@pytest.mark.parametrize("text", ["every:1", "every:x", "every:", "p3.png,q.png"])
def test_held_out_lights_that_are_none(source: Path, text: str) -> None:
    with pytest.raises(InputError, match="--hold-out"):
        photographs.held_out(source, text)


def test_a_missing_photograph_ends_in_one_line(
    source: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (source.parent / "p4.png").unlink()
    assert run([str(a) for a in bake(source)]) == 2
    said = capfd.readouterr().err.strip()
    assert "line 6" in said
    assert said.count("\n") == 0
