"""Sets of sprites: how each is lit, and which fields suit which source."""

from pathlib import Path
from typing import Any

import pytest

from formats import scene
from formats.errors import InputError
from formats.sprites import Billboards

BASE = {"format": 1, "camera": {"position": [0, 1, 5], "target": [0, 1, 0]}}


def one(root: Path | None = None, quality: str = "balanced", **fields: Any) -> Billboards:
    """The only set of a scene."""
    plain = {"name": "thing", "source": "meshes/oak.glb", "height": 1, "positions": [[0, 0, 0]]}
    raw = {**BASE, "quality": quality, "billboards": [{**plain, **fields}]}
    return scene.from_dict(raw, where="a.toml", root=root).billboards[0]


def refused(root: Path | None = None, **fields: Any) -> InputError:
    with pytest.raises(InputError) as caught:
        one(root, **fields)
    return caught.value


def test_a_mesh_gets_a_ring_and_photographs_a_dome() -> None:
    mesh, photographed = one(), one(source="photographs/oak.lp")
    assert mesh.ring is not None
    assert (mesh.dome, mesh.ring.lights, mesh.ring.terms) == (None, 32, 5)
    assert not mesh.photographed
    assert photographed.dome is not None
    assert (photographed.ring, photographed.dome.channels) == (None, 16)
    assert photographed.photographed


def test_what_is_asked_for_is_given() -> None:
    mesh = one(dome={"bands": 4, "penalty": 0.3, "channels": 12}, quality="fine")
    assert mesh.dome is not None
    assert (mesh.dome.bands, mesh.dome.penalty, mesh.dome.channels) == (4, 0.3, 12)
    assert (mesh.ring, mesh.dome.lights) == (None, 96)
    photographed = one(source="photographs/oak.lp", ring={"elevation": 50, "tolerance": 5})
    assert photographed.ring is not None
    assert (photographed.dome, photographed.ring.tolerance) == (None, 5.0)


LP = "photographs/oak.lp"


@pytest.mark.parametrize(
    ("fields", "field", "remedy"),
    [
        ({"ring": {}, "dome": {}}, "dome", "one of them"),
        ({"ring": {}, "dome": {}, "source": LP}, "dome", "one of them"),
        ({"dome": {}, "packing": "full"}, "packing", "a dome has its own"),
        ({"source": LP, "packing": "talk"}, "packing", "a dome has its own"),
        ({"source": LP, "views": 2}, "views", "as they were taken"),
        ({"source": LP, "resolution": 64}, "resolution", "as they were taken"),
        ({"source": LP, "gloss": 0.5}, "gloss", "as they were taken"),
        ({"source": LP, "dome": {"lights": 64}}, "dome.lights", "their own lights"),
        ({"source": LP, "ring": {"lights": 64}}, "ring.lights", "have their own"),
        ({"source": LP, "ring": {"axis": "up"}}, "ring.axis", '"view"'),
        ({"source": LP, "ring": {"elevation": -5}}, "ring.elevation", "0 or more"),
        ({"source": LP, "ring": {"terms": 4}}, "ring.terms", "odd"),
        ({"source": LP, "ring": {"terms": 3}}, "packing", '"full"'),
        ({"ring": {"tolerance": 5}}, "ring.tolerance", "stand on the ring"),
        ({"dome": {"bands": 9}}, "dome.bands", "from 0 to 8"),
        ({"dome": {"channels": 1}}, "dome.channels", "from 2 to 64"),
        ({"dome": {"lights": 5}}, "dome.lights", "from 6 to 1024"),
        ({"source": "photographs/oak.jpg"}, "source", ".lp"),
    ],
    ids=str,
)
def test_what_does_not_suit_is_refused(fields: dict[str, Any], field: str, remedy: str) -> None:
    error = refused(**fields)
    assert error.field == f"billboards[0].{field}"
    assert remedy in error.remedy


def written(root: Path, names: list[str]) -> None:
    """A `.lp` file that names these photographs; those inside its own folder exist."""
    folder = root / "photographs"
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"{name} 0 0 1" for name in names]
    (folder / "oak.lp").write_text("\n".join([str(len(names)), *lines]))
    for name in names:
        if "/" not in name:
            (folder / name).touch()


def test_photographs_are_sources_of_the_scene(tmp_path: Path) -> None:
    written(tmp_path, ["a.png", "b.png", "a.png"])
    raw = {**BASE, "billboards": [{"name": "oak", "source": LP, "height": 1,
                                   "positions": [[0, 0, 0]]}]}  # fmt: skip
    found = scene.from_dict(raw, where="a.toml", root=tmp_path).sources
    assert set(found) == {LP, "photographs/a.png", "photographs/b.png"}
    assert all(path.is_file() for path in found.values())
    # A baked scene carries its assets: nothing is looked up
    assert set(scene.from_dict(raw, where="a.toml", root=None).sources) == {LP}


def test_photographs_outside_the_root_are_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "secret.png").touch()
    root = tmp_path / "assets"
    written(root, ["a.png", "../../secret.png"])
    error = refused(root, source=LP)
    assert "secret.png" in str(error.value)
    written(root, ["a.png", "link.png"])
    (root / "photographs/link.png").unlink()
    (root / "photographs/link.png").symlink_to(tmp_path / "secret.png")
    assert "link.png" in str(refused(root, source=LP).value)


def test_missing_photographs_are_refused_by_name(tmp_path: Path) -> None:
    written(tmp_path, ["a.png", "b.png"])
    (tmp_path / "photographs/b.png").unlink()
    error = refused(tmp_path, source=LP)
    assert (error.field, error.value) == ("line 3", "b.png")


@pytest.mark.parametrize(
    ("fields", "field", "remedy"),
    [
        ({"ring": {}}, "ring", "no light but its own"),
        ({"dome": {}}, "dome", "no light but its own"),
        ({"samples": 4}, "samples", "no light but its own"),
        ({"views": 2}, "views", "no light but its own"),
        ({"packing": "full"}, "packing", "no light but its own"),
        ({"roll": [1, 2]}, "roll", "one a position"),
        ({"radiance": [-1, 0, 0]}, "radiance", "from 0"),
        ({"opacity": 2}, "opacity", "from 0 to 1"),
        ({"facing": "sun"}, "facing", "upright"),
    ],
    ids=str,
)
def test_what_does_not_suit_a_picture_is_refused(
    fields: dict[str, Any], field: str, remedy: str
) -> None:
    error = refused(source="pictures/cell.png", **fields)
    assert str(error.field).startswith(f"billboards[0].{field}")
    assert remedy in error.remedy


@pytest.mark.parametrize(
    "fields",
    [{"roll": [9]}, {"opacity": 0.5}, {"radiance": [2, 2, 2]}, {"facing": "camera"}],
    ids=str,
)
def test_what_only_a_picture_has_is_refused_elsewhere(fields: dict[str, Any]) -> None:
    error = refused(**fields)
    assert error.field == f"billboards[0].{next(iter(fields))}"
    assert "only a picture" in error.remedy
