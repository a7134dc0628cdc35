"""Where a .vox file's scene puts its models."""

import importlib.util
import itertools
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from formats.errors import InputError
from formats.files import vox, vox_nodes, vox_scene
from formats.files.vox import VoxFile
from formats.files.vox_scene import Placement
from tests.formats import vox_bytes as b

WRITER = Path(__file__).parents[2] / "assets/voxels/vox_file.py"
TURNS = [
    first | second << 2 | signs << 4
    for first, second in itertools.permutations(range(3), 2)
    for signs in range(8)
]


@pytest.fixture(scope="module")
def vox_file() -> ModuleType:
    """The writer that the scripts of assets/ use."""
    spec = importlib.util.spec_from_file_location("vox_file", WRITER)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["vox_file"] = module
    spec.loader.exec_module(module)
    return module


def cells_of(scene: vox_scene.Scene) -> dict[tuple[int, ...], int]:
    """Return palette index by cell (x, y, z)."""
    found = np.argwhere(scene.cells)
    return {
        tuple(int(v) for v in at[::-1] + scene.lowest): int(scene.cells[tuple(at)]) for at in found
    }


def slow(file: VoxFile, placed: list[Placement]) -> dict[tuple[int, ...], int]:
    """Place the middle of every cell in floating point, one by one."""
    found = {}
    for placement in placed:
        model = file.models[placement.model]
        for *v, index in model.cells.tolist():
            middle = np.array(v) + 0.5 - np.floor(np.array(model.size) / 2)
            at = np.array(placement.rotation) @ middle + placement.translation
            found[tuple(int(x) for x in np.floor(at))] = index
    return found


def test_a_file_without_a_graph_stands_on_the_ground() -> None:
    file = vox.decode(b.whole(b.model((3, 4, 5), [(0, 0, 0, 1), (2, 3, 4, 2)]), b.ONE), "a.vox")
    scene = vox_scene.flatten(file)
    assert cells_of(scene) == {(-1, -2, 0): 1, (1, 1, 4): 2}
    assert scene.cells.shape == (5, 4, 3)
    assert "first frame" in scene.notes[0]


@pytest.mark.parametrize("size", [(3, 4, 5), (2, 2, 2), (1, 5, 6)])
@pytest.mark.parametrize("code", TURNS)
def test_every_rotation(code: int, size: tuple[int, int, int], rng: np.random.Generator) -> None:
    at = np.unique(rng.integers(0, size, (6, 3)), axis=0)
    cells = [(*place, i + 1) for i, place in enumerate(at.tolist())]
    node = b.transform(0, 1, [b.table(_r=str(code), _t="7 -8 9")])
    file = vox.decode(b.whole(b.model(size, cells), node, b.shape(1, 0)), "a.vox")
    expected = slow(file, [Placement(0, vox_nodes.rotation(code), (7, -8, 9))])
    assert len(expected) == len(cells)
    assert cells_of(vox_scene.flatten(file)) == expected


def test_rotations_are_all_signed_permutations() -> None:
    assert len({vox_nodes.rotation(code) for code in TURNS}) == 48
    for code in TURNS:
        R = np.array(vox_nodes.rotation(code))
        assert np.array_equal(R @ R.T, np.eye(3))


def test_rotations_nest(rng: np.random.Generator) -> None:
    """Of a point p, the outer transform of the inner one: R (R' p + t') + t."""
    for _ in range(20):
        outer, inner = rng.choice(TURNS, 2).tolist()
        t, s = rng.integers(-9, 9, (2, 3))
        frames = [
            b.table(_r=str(code), _t=" ".join(map(str, v.tolist())))
            for code, v in ((outer, t), (inner, s))
        ]
        parts = [
            b.model((2, 3, 4), [(1, 2, 3, 5), (0, 0, 1, 6)]),
            b.transform(0, 1, [frames[0]]),
            b.group(1, 2),
            b.transform(2, 3, [frames[1]]),
            b.shape(3, 0),
        ]
        (placed,) = vox_scene.placements(vox.decode(b.whole(*parts), "a.vox"))
        R, Q = (np.array(vox_nodes.rotation(code)) for code in (outer, inner))
        for p in np.eye(3):
            expected = R @ (Q @ p + s) + t
            assert np.array_equal(np.array(placed.rotation) @ p + placed.translation, expected)


def test_of_several_models_at_one_place_the_last_counts() -> None:
    parts = [b.ONE, b.model((1, 1, 1), [(0, 0, 0, 9)]), b.transform(0, 1), b.group(1, 2, 3)]
    file = vox.decode(b.whole(*parts, b.shape(2, 0), b.shape(3, 1)), "a.vox")
    assert cells_of(vox_scene.flatten(file)) == {(0, 0, 0): 9}


@pytest.mark.parametrize("how", ["transform", "group", "shape", "layer"])
def test_what_is_hidden_is_left_out(how: str) -> None:
    hidden = {"_hidden": "1"}
    layer = b.chunk("LAYR", b.integers(2) + b.table(**hidden) + b.integers(-1))
    parts = [
        b.ONE,
        b.model((1, 1, 1), [(0, 0, 0, 9)]),
        b.transform(0, 1),
        b.group(1, 2, 5),
        b.transform(2, 3, layer=2, **(hidden if how == "transform" else {})),
        b.group(3, 4, **(hidden if how == "group" else {})),
        b.shape(4, 0, **(hidden if how == "shape" else {})),
        b.transform(5, 6, [b.table(_t="3 0 0")]),
        b.shape(6, 1),
        layer if how == "layer" else b"",
    ]
    scene = vox_scene.flatten(vox.decode(b.whole(*parts), "a.vox"))
    assert cells_of(scene) == {(3, 0, 0): 9}
    assert scene.notes == ("1 of 2 placed models are hidden: left out",)


def refused(*parts: bytes) -> str:
    file = vox.decode(b.whole(*parts), "a.vox")
    with pytest.raises(InputError) as caught:
        vox_scene.flatten(file)
    assert str(caught.value).startswith("a.vox: ")
    return str(caught.value)


def test_what_cannot_be_shown_is_refused() -> None:
    assert "which is missing" in refused(b.ONE, b.transform(0, 7))
    assert "contains itself" in refused(b.ONE, b.transform(0, 1), b.group(1, 2, 0), b.shape(2, 0))
    assert "models: 3" in refused(b.ONE, b.shape(0, 3))
    assert "models: -1" in refused(b.ONE, b.shape(0, -1))
    assert "show at least" in refused(b.ONE, b.shape(0, 0, _hidden="1"))
    assert "show at least" in refused(b.model((1, 1, 1), []))
    far = [b.transform(1, 2, [b.table(_t="512 0 0")]), b.shape(2, 0)]
    assert "size: (513, 1, 1)" in refused(b.ONE, b.group(0, 1, 2), *far)
    deep = [b.group(i, i + 1) for i in range(200)]
    assert "too deeply" in refused(b.ONE, *deep, b.shape(200, 0))


def test_a_graph_that_doubles_at_every_node_ends() -> None:
    """Forty groups that hold the next one twice would show a model 2^40 times."""
    doubling = [b.group(i, i + 1, i + 1) for i in range(40)]
    assert "show at most" in refused(b.ONE, *doubling, b.shape(40, 0))


def test_too_many_cells_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nine copies of a model of ten cells, at one place."""
    monkeypatch.setattr(vox_scene, "MAX_CELLS", 89)
    cells = [(i, 0, 0, 1) for i in range(10)]
    parts = [b.model((10, 1, 1), cells), b.group(0, *[1] * 9), b.shape(1, 0)]
    assert "place at most 89" in refused(*parts)


@pytest.mark.parametrize("turn", [4, *TURNS[5::11]])
def test_what_the_writer_wrote_is_read(
    turn: int, vox_file: ModuleType, tmp_path: Path, rng: np.random.Generator
) -> None:
    cells = rng.integers(0, 5, (3, 4, 5)).astype(np.uint8)
    cells[0, 0, 0] = 4
    parts = [
        vox_file.Part(cells, (2, -3, 4), "a", turn=turn),
        vox_file.Part(np.full((1, 1, 2), 7, np.uint8), (40, 0, 0), layer=3),
        vox_file.Part(np.full((2, 1, 1), 8, np.uint8), (50, 0, 0), hidden=True),
    ]
    glow = {3: vox_file.Glow(0.5, 2.0)}
    path = tmp_path / "a.vox"
    vox_file.write(path, parts, {3: "#ff8000", 7: "#010203"}, glow, hidden_layers=[3])
    file = vox.read(path)
    assert file.palette[3].tolist() == [255, 128, 0, 255]
    # 0.5 times 10^2
    assert file.materials[3].emission == 50.0
    assert sum(m.emission > 0 for m in file.materials) == 1
    scene = vox_scene.flatten(file)
    assert scene.notes == ("2 of 3 placed models are hidden: left out",)
    # The box as numpy turns it: axis a of the result is axis order[a] of the part, flipped or not
    R = np.array(vox_nodes.rotation(turn))
    turned = cells.transpose(2, 1, 0).transpose(np.abs(R).argmax(axis=1))
    turned = np.flip(turned, [axis for axis in range(3) if R[axis].sum() < 0]).transpose(2, 1, 0)
    filled = np.argwhere(turned)
    lowest = filled.min(axis=0)
    box = turned[tuple(slice(a, c + 1) for a, c in zip(lowest, filled.max(axis=0), strict=True))]
    assert np.array_equal(scene.cells, box)
    assert scene.lowest == tuple((np.array([2, -3, 4]) + lowest[::-1]).tolist())


def test_the_writer_cuts_large_worlds(
    vox_file: ModuleType, tmp_path: Path, rng: np.random.Generator
) -> None:
    cells = np.zeros((3, 300, 290), np.uint8)
    cells[tuple(rng.integers(0, cells.shape, (500, 3)).T)] = 3
    cells[0, 0, 0] = cells[2, 299, 289] = 1
    path = tmp_path / "a.vox"
    vox_file.write(path, [vox_file.Part(cells, (-5, 6, 7))], {1: "#ffffff"})
    file = vox.read(path)
    assert len(file.models) == 4
    scene = vox_scene.flatten(file)
    assert np.array_equal(scene.cells, cells)
    assert scene.lowest == (-5, 6, 7)


def test_the_writer_writes_the_same_bytes(vox_file: ModuleType, tmp_path: Path) -> None:
    parts = [vox_file.Part(np.ones((2, 2, 2), np.uint8))]
    for name in ("a", "b"):
        vox_file.write(tmp_path / name, parts, {1: "#123456"}, version=200)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert vox.read(tmp_path / "a").version == 200
