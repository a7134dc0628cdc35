"""OpenEXR: lossless whatever the memory layout, names kept, half floats never infinite."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from formats.errors import InputError, MachineError
from formats.files import exr


@pytest.mark.parametrize("compression", ["none", "rle", "zips", "zip", "piz"])
@pytest.mark.parametrize("half", [True, False])
def test_parts_come_back_bit_for_bit(
    compression: str, half: bool, tmp_path: Path, rng: np.random.Generator
) -> None:
    kind = np.float16 if half else np.float32
    parts = {
        "view0.term1": rng.normal(0, 100, (5, 7, 3)).astype(kind),
        "alpha": rng.random((5, 7, 1)).astype(kind),
        "other size": rng.random((9, 2, 4)).astype(kind),
    }
    clamped = exr.write(tmp_path / "a.exr", parts, half=half, compression=compression)
    back = exr.read(tmp_path / "a.exr")
    assert clamped == 0
    assert list(back) == list(parts)
    for name, pixels in parts.items():
        np.testing.assert_array_equal(back[name], pixels.astype(np.float32), strict=True)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_one_part_keeps_its_name(channels: int, tmp_path: Path, rng: np.random.Generator) -> None:
    pixels = rng.random((3, 5, channels), np.float32)
    exr.write(tmp_path / "a.exr", {"beauty": pixels})
    np.testing.assert_array_equal(exr.read(tmp_path / "a.exr")["beauty"], pixels, strict=True)


def test_views_of_arrays_are_written_right(tmp_path: Path, rng: np.random.Generator) -> None:
    """OpenEXR 3.5.3 itself writes wrong pixels for all of these (openexr issue 1929)."""
    source = rng.random((6, 6, 4), np.float32)
    parts = {
        "slice": source[..., :3],
        "flipped": source[::-1],
        "transposed": source.transpose(1, 0, 2),
        "fortran": np.asfortranarray(source),
        "double": source.astype(np.float64)[..., 1:2],
        "big endian": source.astype(">f4"),
        "broadcast": np.broadcast_to(np.float32([1, 2, 3]), (6, 6, 3)),
    }
    exr.write(tmp_path / "a.exr", parts)
    back = exr.read(tmp_path / "a.exr")
    for name, pixels in parts.items():
        np.testing.assert_array_equal(back[name], pixels)


def test_half_clamps_what_would_become_infinite_and_counts_it(tmp_path: Path) -> None:
    pixels = np.array([[[65504.0, 65505.0, -1e30], [1e-9, 0.5, 3e38]]], np.float32)
    assert exr.write(tmp_path / "a.exr", {"a": pixels}, half=True) == 3
    back = exr.read(tmp_path / "a.exr")["a"]
    np.testing.assert_array_equal(back, [[[65504, 65504, -65504], [0, 0.5, 65504]]])
    assert exr.write(tmp_path / "b.exr", {"a": pixels}) == 0
    np.testing.assert_array_equal(exr.read(tmp_path / "b.exr")["a"], pixels)


def test_other_readers_see_names_channels_and_attributes(tmp_path: Path) -> None:
    pixels = np.zeros((2, 4, 3), np.float32)
    attributes = {"envmap": OpenEXR.ENVMAP_LATLONG, "comments": "a ring of 64 lights", "terms": 5}
    exr.write(tmp_path / "a.exr", {"x": pixels, "y": pixels[..., :1]}, attributes=attributes)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert [part.name() for part in file.parts] == ["x", "y"]
        assert [sorted(part.channels) for part in file.parts] == [["B", "G", "R"], ["Y"]]
        for part in file.parts:
            assert {key: part.header[key] for key in attributes} == attributes


def test_layers_and_odd_channels_of_other_writers(tmp_path: Path, rng: np.random.Generator) -> None:
    names = ["left.R", "left.G", "left.B", "Y", "R", "G", "B", "Z", "N.X"]
    planes = {name: rng.random((2, 3), np.float32) for name in names}
    header = {"type": OpenEXR.scanlineimage}
    OpenEXR.File(header, dict(planes)).write(str(tmp_path / "a.exr"))
    back = exr.read(tmp_path / "a.exr")
    assert next(iter(back)) == ""  # the plain picture comes first
    for key, channels in {
        "": "R G B",
        "left": "left.R left.G left.B",
        "Y": "Y",
        "Z": "Z",
        "N.X": "N.X",
    }.items():
        expected = np.stack([planes[name] for name in channels.split()], axis=2)
        np.testing.assert_array_equal(back.pop(key), expected)
    assert not back


def test_whole_numbers_and_infinity_in_a_file_are_refused(tmp_path: Path) -> None:
    header = {"type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"id": np.ones((2, 2), np.uint32)}).write(str(tmp_path / "id.exr"))
    OpenEXR.File(header, {"Y": np.full((2, 2), np.inf, np.float32)}).write(str(tmp_path / "y.exr"))
    with pytest.raises(InputError, match="id: uint32"):
        exr.read(tmp_path / "id.exr")
    with pytest.raises(InputError, match="not finite"):
        exr.read(tmp_path / "y.exr")


@pytest.mark.parametrize(
    ("parts", "options"),
    [
        ({}, {}),
        ({"a": np.zeros((2, 2, 2), np.float32)}, {}),
        ({"a": np.zeros((2, 2), np.float32)}, {}),
        ({"a": np.zeros((2, 2, 3), np.uint8)}, {}),
        ({"a": np.full((2, 2, 3), 1e300)}, {}),
        ({"a": np.zeros((2, 2, 3))}, {"compression": "dwaa"}),
        ({"a\0b": np.zeros((2, 2, 3))}, {}),
        ({"a": np.zeros((2, 2, 3))}, {"attributes": {"when": object()}}),
    ],
)
def test_unfit_parts_are_refused(parts: dict, options: dict, tmp_path: Path) -> None:
    with pytest.raises(InputError):
        exr.write(tmp_path / "a.exr", parts, **options)
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_the_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenEXR says "failed to write" whatever happened, so the disk is asked."""

    def fail(self: object, name: str) -> None:
        raise RuntimeError("failed to write image file")

    monkeypatch.setattr(OpenEXR.File, "write", fail)
    pixels = {"a": np.zeros((2, 2, 3), np.float32)}
    with pytest.raises(InputError):
        exr.write(tmp_path / "a.exr", pixels)
    full = shutil.disk_usage(tmp_path)._replace(free=0)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: full)
    with pytest.raises(MachineError):
        exr.write(tmp_path / "a.exr", pixels)
    assert not list(tmp_path.iterdir())


def test_openexr_is_imported_only_when_used() -> None:
    code = "import formats.files.exr, sys; sys.exit('OpenEXR' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.skipif(
    "BAKELIGHT_DATA" not in os.environ, reason="BAKELIGHT_DATA is not set: real EXR maps"
)
@pytest.mark.parametrize("name", ["studio", "sunset", "forest", "night", "warehouse", "lobby"])
def test_real_maps_are_read(name: str) -> None:
    path = Path(os.environ["BAKELIGHT_DATA"]) / "hdr" / "pmndrs" / f"{name}.exr"
    (picture,) = exr.read(path).values()
    assert picture.shape[:2] == (256, 512)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for i, channel in enumerate("RGB"):
            np.testing.assert_array_equal(picture[..., i], file.channels()[channel].pixels)


def test_layers_are_channels_of_one_part(tmp_path: Path, rng: np.random.Generator) -> None:
    light = rng.random((3, 5, 3)).astype(np.float16)
    # Views that are not contiguous are stored as they look
    normal = rng.normal(0, 1, (3, 5, 6)).astype(np.float32)[::-1, :, ::2]
    layers = {"": ("RGB", light), "normal": ("XYZ", normal)}
    exr.write_layers(tmp_path / "a.exr", layers, attributes={"software": "x"})
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert len(file.parts) == 1
        found = {name: channel.pixels for name, channel in file.channels().items()}
    assert sorted(found) == ["B", "G", "R", "normal.X", "normal.Y", "normal.Z"]
    for name, pixels in (("", light), ("normal", normal)):
        for number, letter in enumerate(layers[name][0]):
            label = f"{name}.{letter}".lstrip(".")
            np.testing.assert_array_equal(found[label], pixels[..., number], strict=True)
    assert next(iter(exr.read(tmp_path / "a.exr"))) == ""


@pytest.mark.parametrize(
    "layers",
    [
        {},
        {"": ("RGB", np.zeros((2, 2, 4), np.float16))},
        {"": ("Z", np.zeros((2, 2, 1), np.float64))},
        {"": ("Z", np.full((2, 2, 1), np.inf, np.float32))},
        {"a": ("Z", np.zeros((2, 2, 1), np.float32)), "b": ("Z", np.zeros((2, 3, 1), np.float32))},
    ],
)
def test_layers_that_cannot_be_written(layers: dict[str, object], tmp_path: Path) -> None:
    with pytest.raises(InputError):
        exr.write_layers(tmp_path / "a.exr", layers)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_names_that_are_no_utf8_are_refused_by_name(tmp_path):
    """OpenEXR cannot open them and speaks of its arguments."""
    path = tmp_path / os.fsdecode(b"\xff.exr")
    with pytest.raises(InputError, match="not UTF-8"):
        exr.write(path, {"": np.ones((2, 2, 3), np.float32)})
    path.write_bytes(b"v/1\x01")
    with pytest.raises(InputError, match="not UTF-8"):
        exr.read(path)
