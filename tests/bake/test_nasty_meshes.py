"""Meshes as bad as they come: occlusion and transfer bake, or are refused in one line each."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bake import compress, occlusion, sources, transfer
from formats import report
from formats.errors import InputError
from formats.mesh import Mesh
from pipelines import single
from pipelines.cli import cli, run
from tests.bake import small_meshes
from tests.bake.small_meshes import mesh_of

single.add_to(cli)
COARSE = occlusion.Params(grid=8, l_max=3, rays=64, proof=4)
ROUGH = transfer.Params(rays=32, l_max=2, bounces=1, edge=0.0)
FULL = 2 * np.sqrt(np.pi)


def outcome(make: Callable[[], Mesh], require: Callable[[Mesh], None]) -> str:
    """Bake what a function makes: "baked", or what it is refused with."""
    try:
        require(make())
    except InputError as error:
        text = str(error)
        # One line: where, what is wrong, and after the dash what to do
        assert "\n" not in text
        assert " -- " in text
        return text
    return "baked"


def require_occlusion(mesh: Mesh) -> None:
    master = occlusion.trace(mesh, params=COARSE)
    for array in (master.terms, master.spread, master.error, master.proof_shadow):
        assert np.isfinite(array).all()
    # A share of the sphere; the sum over few rays of equal weight cannot exceed it
    assert master.terms[..., 0].min() >= 0
    assert master.terms[..., 0].max() <= FULL * (1 + 1e-5)
    assert min(master.box.half_extent) > 0
    assert np.isfinite(compress.compress(master, params=compress.Params()).decoded()).all()


def require_transfer(mesh: Mesh) -> None:
    found = transfer.trace(mesh, params=ROUGH)
    vectors = found.layout.decoded(found.codes)
    assert np.isfinite(vectors).all()
    # A constant light of radiance 1 is Y00 / Y00^2 = 2 sqrt(pi): irradiance within 0 and pi, but
    # for codes of 8 bits of 27 numbers
    irradiance = vectors[..., 0] * FULL
    assert irradiance.min() > -0.1 * np.pi
    assert irradiance.max() < 1.1 * np.pi


# Made here


def inverted() -> Mesh:
    ball = small_meshes.sphere(8, 12)
    return mesh_of(ball.vertices, ball.faces[:, ::-1])


def doubled() -> Mesh:
    box = small_meshes.box()
    return mesh_of(box.vertices, np.concatenate([box.faces, box.faces]))


def two_backs() -> Mesh:
    """A sheet and its back in the same place."""
    plate = small_meshes.plate()
    return mesh_of(plate.vertices, np.concatenate([plate.faces, plate.faces[:, ::-1]]))


def slivers() -> Mesh:
    """A fan of triangles a ten-millionth as wide as long."""
    turn = 1e-7 * np.arange(200)
    rim = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    faces = [[0, i + 1, i + 2] for i in range(199)]
    return mesh_of(np.concatenate([[[0, 0, 0.0]], rim, [[0, 1.0, 1.0]]]), [*faces, [0, 1, 201]])


def moebius() -> Mesh:
    """A strip with one side: no way to turn its faces agrees."""
    n = 48
    u = 2 * np.pi * np.arange(n) / n
    rows = []
    for side in (-0.3, 0.3):
        wide = 1 + side * np.cos(u / 2)
        rows.append(np.stack([wide * np.cos(u), side * np.sin(u / 2), wide * np.sin(u)], axis=-1))
    faces = []
    for i in range(n):
        a, b, c, d = i, i + 1, n + i + 1, n + i
        if i == n - 1:
            b, c = n, 0
        faces += [[a, b, c], [a, c, d]]
    return mesh_of(np.concatenate(rows), faces)


def three_sheets() -> Mesh:
    """Three faces on one edge."""
    points = [[0, 0, 0], [0, 1, 0], [1, 0, 0], [-0.5, 0, 0.9], [-0.5, 0, -0.9]]
    return mesh_of(points, [[0, 1, 2], [0, 1, 3], [0, 1, 4]])


def bow_tie() -> Mesh:
    """Two solids that touch in a point."""
    one = np.array([[0, 0, 0], [1, 0, 0.2], [0, 1, 0.3], [0.1, 0.2, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    other = np.where(faces == 0, 0, faces + 3)[:, ::-1]
    return mesh_of(np.concatenate([one, -one[1:]]), np.concatenate([faces, other]))


def crossing() -> Mesh:
    return small_meshes.joined(
        small_meshes.box((1.0, 0.3, 0.3)), small_meshes.box((0.3, 0.3, 1.0), (0.1, 0.05, 0.0))
    )


def soup() -> Mesh:
    points = np.random.default_rng(3).normal(size=(900, 3))
    return mesh_of(points, np.arange(900).reshape(-1, 3))


def dust() -> Mesh:
    """Two specks a million times as far apart as they are wide."""
    speck = small_meshes.sphere(4, 6)
    far = replace(speck, vertices=speck.vertices + np.array([1e6, 0, 0]))
    return small_meshes.joined(speck, far)


def crumbs() -> Mesh:
    """A box, and a point, a line and a vertex that no face uses, a billion times as far away."""
    box = small_meshes.box()
    points = np.concatenate([box.vertices, [[1e9, 0, 0]], [[3e9, 0, 0]]])
    return replace(
        box,
        vertices=points,
        faces=np.concatenate([box.faces, [[8, 8, 8], [0, 0, 8]]]),
        normals=np.concatenate([box.normals, box.normals[:2]]),
        material=np.zeros(14, np.int32),
    )


def scaled(factor: float, offset: float = 0.0) -> Mesh:
    ball = small_meshes.sphere(8, 12)
    return replace(ball, vertices=ball.vertices * factor + offset)


def spoilt(value: float) -> Mesh:
    ball = small_meshes.sphere(4, 6)
    points = ball.vertices.copy()
    points[3, 1] = value
    return replace(ball, vertices=points)


BOX = small_meshes.box()
BAKED: dict[str, Callable[[], Mesh]] = {
    "one triangle": lambda: mesh_of(np.eye(3), [[0, 1, 2]]),
    "inside out": inverted,
    "every face twice": doubled,
    "a sheet and its back": two_backs,
    "slivers": slivers,
    "a Moebius strip": moebius,
    "three sheets on an edge": three_sheets,
    "two solids in a point": bow_tie,
    "solids that cross": crossing,
    "a box without a lid": lambda: mesh_of(BOX.vertices, BOX.faces[:10]),
    "a soup": soup,
    "specks far apart": dust,
    "crumbs of a box": crumbs,
    "a needle": lambda: small_meshes.box((1.0, 1e-6, 1e-6)),
    "tiny": lambda: scaled(1e-20),
    "large": lambda: scaled(1e20),
    "a million sizes away": lambda: scaled(1.0, 1e6),
}
REFUSED: dict[str, tuple[Callable[[], Mesh], str]] = {
    "no faces": (
        lambda: replace(
            BOX, faces=BOX.faces[:0], normals=BOX.normals[:0], material=BOX.material[:0]
        ),
        "faces",
    ),
    "a line": (lambda: replace(BOX, vertices=BOX.vertices * [1, 0, 0]), "area"),
    "a point": (lambda: replace(BOX, vertices=BOX.vertices * 0), "area"),
    "NaN": (lambda: spoilt(np.nan), "vertices"),
    "infinity": (lambda: spoilt(np.inf), "vertices"),
    "a corner at 1e99": (lambda: spoilt(1e99), "scale the mesh"),
    "too large": (lambda: scaled(1e33), "scale the mesh"),
    "too small": (lambda: scaled(1e-33), "scale the mesh"),
    "index out of range": (lambda: replace(BOX, faces=BOX.faces + 1), "faces"),
    "negative index": (lambda: replace(BOX, faces=BOX.faces - 1), "faces"),
    "double the normals": (lambda: replace(BOX, normals=2 * BOX.normals), "normals"),
}


# Of what the player moves about, coordinates are float32 and lie within 1,000 km
FAR = ("specks far apart", "crumbs of a box", "large", "a million sizes away")


@pytest.mark.parametrize("name", BAKED)
def test_what_has_an_area_bakes(name: str) -> None:
    assert outcome(BAKED[name], require_occlusion) == "baked"
    found = outcome(BAKED[name], require_transfer)
    assert "1e+06 m" in found if name in FAR else found == "baked"


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_mesh_is_refused(name: str) -> None:
    make, words = REFUSED[name]
    assert words in outcome(make, require_occlusion)
    # Transfer holds no volume: it takes any size that float32 can tell from nothing
    found = outcome(make, require_transfer)
    assert (found == "baked") == (name == "too small")


@pytest.mark.parametrize(
    ("name", "words"), [("inside out", "inside out"), ("a sheet and its back", "100% of the")]
)
def test_what_is_odd_is_noted(name: str, words: str) -> None:
    notes = occlusion.trace(BAKED[name](), params=COARSE).quality["notes"]
    assert sum(words in note for note in notes) == 1


@pytest.mark.parametrize(("thick", "told"), [(0.02, True), (0.6, False)])
def test_the_command_tells_of_thin_walls(
    thick: float, told: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A voxel of a box padded to a quarter of its length is a sixteenth of it thick, here .0625."""
    box, source = small_meshes.box((1.0, 1.0, thick)), tmp_path / "box.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in box.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in box.faces + 1]
    source.write_text("\n".join(lines))
    sizes = ("--grid", "16", "--rays", "32", "--build", str(tmp_path / "b"))
    assert run(["occlusion", str(source), "-o", str(tmp_path / "out"), *sizes]) == 0
    assert ("thinner than a voxel" in capfd.readouterr().err) == told
    notes = report.read(tmp_path / "out")["quality"]["notes"]
    # Of 8 + 8 thick two sides of 4 are thin, the four others 2 deep
    assert [note[:3] for note in notes] == (["96%"] if told else [])


def test_what_is_sound_is_not_noted() -> None:
    fine = replace(COARSE, grid=16)
    assert occlusion.trace(small_meshes.sphere(8, 12), params=fine).quality["notes"] == []


# Real files


DATA = os.environ.get("BAKELIGHT_DATA")
MESHES = Path(DATA or ".") / "meshes"
FILES = sorted(p for p in MESHES.rglob("*") if p.is_file() and p.suffix != ".md") if DATA else []


@pytest.mark.slow
@pytest.mark.skipif(not DATA, reason="BAKELIGHT_DATA names no folder of real meshes")
@pytest.mark.parametrize("path", FILES or [Path("none")], ids=lambda p: p.name)
def test_real_files_bake_or_are_refused(path: Path) -> None:
    loaded: list[Mesh] = []
    found = outcome(lambda: sources.load(path), loaded.append)
    if not loaded:
        assert found.startswith(str(path))
        return
    for require in (require_occlusion, require_transfer):
        assert outcome(lambda: loaded[0], require) == "baked"
