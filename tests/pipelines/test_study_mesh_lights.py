"""The study of lamps on a mesh: its truths against each other, and what it says."""

from pathlib import Path

import numpy as np
import pytest

from bake.reference_scene import Part, merged
from bake.reference_world import World
from formats import scene as scenes
from formats.effects import MOST_LIGHTS
from pipelines.plan import build
from pipelines.studies import lamp_truth, mesh_lights
from pipelines.studies.shadow_lights import lamps
from pipelines.studies.subjects import Setting
from tests.bake import small_meshes
from tests.pipelines.test_studies import check_form


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of a ball of 100 m that stands far from its origin."""
    vertices, faces = small_meshes.sphere_arrays(24, 48)
    lines = [f"v {x} {y} {z}" for x, y, z in 100 * vertices + [500, 0, -300]]
    lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
    path = tmp_path_factory.mktemp("ball") / "ball.obj"
    path.write_text("\n".join(lines))
    return path


def test_sums_are_those_of_far_small_balls(rng: np.random.Generator) -> None:
    points, normals = rng.uniform(-0.1, 0.1, (40, 3)), small_meshes.directions(rng, 40)
    own = lamps("balls", 30)
    expected = np.zeros((40, 3))
    for lamp in own:
        offset = lamp.position.at(0.0) - points
        distance = np.linalg.norm(offset, axis=1)
        cosine = np.einsum("ni,ni->n", offset, normals) / distance
        # Lamps of .1 to .5 m at 3 to 8: where they set, they are cut off within a sixth of it
        power = np.pi * np.square(lamp.radius / distance) * np.maximum(cosine, 0)
        expected += power[:, None] * lamp.radiance.at(0.0)
    found = mesh_lights.sums(points, normals, own)
    np.testing.assert_allclose(found, expected, rtol=0.02, atol=0.01 * expected.mean())


def test_chunks_of_lamps_add_up(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator) -> None:
    points, normals = rng.uniform(-1, 1, (7, 3)), small_meshes.directions(rng, 7)
    whole = mesh_lights.sums(points, normals, lamps("balls", 30))
    monkeypatch.setattr(mesh_lights, "EACH", 28)
    found = mesh_lights.sums(points, normals, lamps("balls", 30))
    np.testing.assert_allclose(found, whole, rtol=1e-12)


def test_both_truths_are_one_where_nothing_hides(rng: np.random.Generator) -> None:
    ball = small_meshes.sphere(24, 48)
    world = World(merged([Part(ball, np.eye(4)[None], np.ones((1, 3)))]), None)
    normals, own = small_meshes.directions(rng, 200), lamps("balls", 20)
    at = 1.001 * normals
    traced = lamp_truth.irradiance(world, at, normals, 0.0, own, 64)
    summed = mesh_lights.sums(at, normals, own)
    # 64 even rays to each small ball; a facet may hide what sets
    np.testing.assert_allclose(traced, summed, rtol=0.02, atol=0.02 * summed.mean())


def test_smooth_pieces_leave_out_outlines_and_creases() -> None:
    seen = np.zeros((12, 16), bool)
    seen[1:11, 1:15] = True
    normals = np.zeros((12, 16, 3))
    normals[:, :8, 2] = normals[:, 8:, 0] = 1
    found = mesh_lights.smooth(normals[seen], seen)
    expected = np.zeros_like(seen)
    expected[2:10, 2:7] = expected[2:10, 9:14] = True
    np.testing.assert_array_equal(found, expected)


def test_an_even_error_is_told_as_it_is() -> None:
    truth = np.ones((24, 24, 3))
    found = mesh_lights.error_of(1.1 * truth, truth, np.ones((24, 24), bool))
    assert found.value == pytest.approx(0.1)
    assert found.low == pytest.approx(found.high)
    # Dark pixels and a few that are far off change nothing
    truth[:9], played = 0, 1.1 * truth
    played[-2:] = 50
    found_own = mesh_lights.middle_error(played, truth, np.ones((24, 24), bool))
    assert found_own == pytest.approx(0.1 * 24 / 15)


def test_a_ball_of_any_size_and_place_is_measured(
    ball: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mesh_lights, "QUICK", (1, MOST_LIGHTS))
    monkeypatch.setattr(mesh_lights, "_sizes", lambda _: ((32, 18), (48, 48)))
    answer = mesh_lights.measure(Setting(quick=True, source=ball))
    check_form(answer)
    assert {row["subject"] for row in answer.points} == {"ball"}
    direct = [row for row in answer.points if row["series"] == "direct"]
    assert [row["lamps"] for row in direct] == [1, MOST_LIGHTS]
    # A ball hides nothing from itself. Pixels on edges between facets mix two; measured .0008, .003
    assert max(row["formula_error"] for row in direct) < 0.002
    assert max(row["error"] for row in direct) < 0.02


@pytest.mark.parametrize(("way", "drawn"), mesh_lights.WAYS.items())
def test_every_way_calls_for_its_pass_alone(way: str, drawn: str, ball: Path) -> None:
    data = mesh_lights.described(way, ball, quick=True)
    scene = scenes.from_dict(data, where="x.json", root=None)
    called = {effect.name for effect in build(scene).effects if effect.called}
    assert drawn in called
    assert not called & (set(mesh_lights.WAYS.values()) - {drawn})
    # The ball that holds it, of radius 1, stands in the middle
    mesh = scene.meshes[0]
    np.testing.assert_allclose(
        mesh.scale * np.array([500.0, 0, -300]) + mesh.position.at(0.0), 0, atol=1e-3
    )
    assert mesh.scale * 100 * 3**0.5 == pytest.approx(1, rel=1e-6)
