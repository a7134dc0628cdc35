"""Layered pictures: what compositing programs read in the file; sequences that go on."""

import json
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from formats.errors import InputError
from pipelines import layers
from pipelines.cli import run
from pipelines.render_scene import Options, render_scene
from runtime.layers import CHANNELS

pytestmark = pytest.mark.gpu


def test_names_are_checked() -> None:
    assert layers.parse(None, Path("a.png")) == ()
    assert layers.parse("all", Path("a.EXR")) == tuple(CHANNELS)
    assert layers.parse("depth, id,depth", Path("a.exr")) == ("depth", "id")
    for text, out in (("depht", "a.exr"), ("depth", "a.png"), ("", "a.exr")):
        with pytest.raises(InputError):
            layers.parse(text, Path(out))


def test_channels_and_header_are_as_compositors_read_them(assets: Path, tmp_path: Path) -> None:
    job = render_scene(
        assets / "scenes/surface.toml",
        tmp_path / "a.exr",
        size="64x36",
        times=(0.25,),
        build_folder=tmp_path / "build",
        options=Options(layers="all"),
    )
    with OpenEXR.File(str(job.files[0]), separate_channels=True) as file:
        # Closing empties it
        header, channels = dict(file.header()), file.channels()
        assert len(file.parts) == 1
        wanted = {f"{name}.{c}" for name, letters in CHANNELS.items() for c in letters}
        assert set(channels) == wanted | {"R", "G", "B"}
        pixels = {name: channel.pixels.astype(np.float64) for name, channel in channels.items()}
    assert header["time"] == 0.25
    assert header["software"] == "Bakelight"
    # A point of a pixel lands in its middle again: rows times matrix, as OpenEXR has it
    position = np.stack([pixels[f"position.{c}"] for c in "XYZ"], axis=-1)
    there = pixels["id.I"] == 1
    assert there.sum() > 20
    points = np.concatenate([position, np.ones((36, 64, 1))], axis=-1)
    clip = points @ header["worldToNDC"].astype(np.float64)
    row, column = np.indices((36, 64))
    x = (clip[..., 0] / clip[..., 3] + 1) * 32 - 0.5
    y = (1 - clip[..., 1] / clip[..., 3]) * 18 - 0.5
    # Float32 of positions and matrix: measured 5e-5 pixels
    assert np.abs(x - column)[there].max() < 1e-3
    assert np.abs(y - row)[there].max() < 1e-3
    view = points @ header["worldToCamera"].astype(np.float64)
    # The depth is that of a sample, up to half a pixel beside the middle: seen at up to 60 degrees
    assert np.median(np.abs(-view[..., 2] - pixels["depth.Z"])[there]) < 0.05
    assert np.all(pixels["depth.Z"][pixels["coverage.A"] == 0] == np.float32(1e10))


def test_light_alone_says_where_it_was_seen_from(assets: Path, tmp_path: Path) -> None:
    from formats.files import exr

    out = tmp_path / "a.exr"
    scene, build = assets / "scenes/plain.toml", tmp_path / "build"
    render_scene(scene, out, size="8x8", build_folder=build)
    assert list(exr.read(out)) == ["beauty"]
    with OpenEXR.File(str(out)) as file:
        assert file.header()["worldToCamera"].shape == (4, 4)


def test_a_sequence_goes_on_where_it_stopped(
    assets: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    scene, out = assets / "scenes/plain.toml", tmp_path / "s" / "a.####.png"
    flags = ["--size", "8x8", "--build", tmp_path / "build", "--skip-existing", "--json"]

    def render(frames: str) -> dict[str, object]:
        words = ["render", scene, "-o", out, "--frames", frames, *flags]
        assert run([str(word) for word in words]) == 0
        found: dict[str, object] = json.loads(capfd.readouterr().out)
        return found

    first = render("0:2")
    kept = (tmp_path / "s/a.0001.png").stat().st_mtime_ns
    second = render("0:3")
    assert (first["frames"], second["frames"]) == (2, 1)
    assert second["files"] == [str(tmp_path / "s/a.0002.png")]
    assert second["skipped"] == [str(tmp_path / f"s/a.000{n}.png") for n in (0, 1)]
    assert second["size"] == [8, 8]
    assert second["bytes"] == (tmp_path / "s/a.0002.png").stat().st_size
    assert (tmp_path / "s/a.0001.png").stat().st_mtime_ns == kept
