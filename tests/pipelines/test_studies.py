"""Studies measure against truths that are right, by closed forms and slow obvious versions."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from bake import billboard, mips
from formats.errors import InputError
from formats.mesh import Material, Mesh
from maths import circular_harmonics
from pipelines.studies import (
    bench,
    lens_by_mips,
    light_directions,
    meshes,
    ray_calls,
    ring_models,
    run,
    subjects,
    thin_lens,
)
from pipelines.studies.answer import PRICES, Answer

LANTERN = subjects.MESHES / "lantern.glb"
QUICK = subjects.Setting(quick=True, source=LANTERN)


def quad() -> Mesh:
    """A square of a metre that faces +z and fills its sprite."""
    corners = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [-0.5, 1, 0]], np.float64)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    normals = np.zeros((2, 3, 3), np.float32)
    normals[..., 2] = 1
    return Mesh(corners, faces, normals, np.zeros(2, np.int32), (Material(),))


# the lens


def test_lens_is_the_mean_of_shifted_copies(rng: np.random.Generator) -> None:
    sprite = rng.random((9, 7, 2)).astype(np.float32)
    diameter, samples = 5.3, 256
    blurred, margin = thin_lens.through_lens(sprite, diameter, samples)
    slow = np.zeros(blurred.shape)
    for x, y in thin_lens.aperture(diameter, samples):
        # A copy moved by (x, y), averaged over each texel's square
        rows = np.arange(blurred.shape[0] + 1) - margin - y
        columns = np.arange(blurred.shape[1] + 1) - margin - x
        slow += thin_lens.averaged(thin_lens.averaged(sprite, rows, 0), columns, 1)
    # Single precision and an FFT of 19 x 17: a few units of 6e-8
    np.testing.assert_allclose(blurred, slow / samples, atol=2e-6)


def test_lens_blurs_a_point_to_a_disc() -> None:
    point = np.zeros((41, 41, 1), np.float32)
    point[20, 20] = 1
    diameter = 24.0
    blurred, margin = thin_lens.through_lens(point, diameter, 4096)
    x = np.arange(len(blurred)) - 20 - margin
    assert blurred.sum() == pytest.approx(1, abs=1e-5)
    # Along one axis a disc has variance R^2 / 4; weighing two texels adds f (1 - f), 1/6 on average
    variance = float(np.einsum("ijc,j->", blurred, x**2.0))
    assert variance == pytest.approx(diameter**2 / 16 + 1 / 6, rel=1e-2)
    inside = blurred[len(x) // 2, np.abs(x) < diameter / 2 - 2]
    # Even to the rim: 4,096 samples on 452 texels, Vogel's spiral, within 15 % a texel
    np.testing.assert_allclose(inside, 4 / (np.pi * diameter**2), rtol=0.15)


def test_averages_keep_the_sum_and_are_zero_outside(rng: np.random.Generator) -> None:
    image = rng.random((8, 3)).astype(np.float32)
    means = thin_lens.averaged(image, np.array([-3.0, -1.0, 0.4, 2.7, 8.0, 9.5]), 0)
    assert means[0].tolist() == [0, 0, 0]
    np.testing.assert_allclose(means[1], 0.4 * image[0] / 1.4, rtol=1e-6)
    widths = np.array([2, 1.4, 2.3, 5.3, 1.5])
    np.testing.assert_allclose(widths @ means, image.sum(axis=0), rtol=1e-6)


def test_lookups_are_linear_between_centres_and_clamped() -> None:
    ramp = (np.arange(6, dtype=np.float32) + 0.5)[:, None]
    at = np.array([-2.0, 0.5, 1.25, 3.5, 5.9, 40.0])
    looked = thin_lens.sampled(ramp, at, 0)[:, 0]
    assert looked.tolist() == [0.5, 0.5, 1.25, 3.5, 5.5, 5.5]


def test_level_is_the_coarser_of_the_hardware_and_the_lens() -> None:
    # A 512-texel sprite at 64 pixels reads level 3 by itself; 16 texels of blur ask for 4
    assert thin_lens.level_of(0, 8, 1.0) == 3
    assert thin_lens.level_of(4, 8, 1.0) == 3
    assert thin_lens.level_of(16, 8, 1.0) == 4
    assert thin_lens.level_of(0.2, 0.5, 1.0) == 0
    assert thin_lens.level_of(1e9, 1, 1.0, max_lod=5.0) == 5


def test_error_of_a_blend_is_the_mean_square(rng: np.random.Generator) -> None:
    truth, fine, coarse = rng.random((3, 50))
    off, step = truth - fine, coarse - fine
    pair = lens_by_mips.Pair(np.mean(off * off), np.mean(off * step), np.mean(step * step))
    for part in (0.0, 0.3, 1.0):
        blend = fine + part * step
        assert pair.blended(part) == pytest.approx(float(np.mean((truth - blend) ** 2)), rel=1e-12)


@pytest.mark.parametrize("filter", mips.FILTERS)
def test_crossing_an_integer_level_is_invisible(filter: str, rng: np.random.Generator) -> None:
    level0 = np.zeros((1, 128, 128, 4), np.float32)
    level0[0, 32:96, 32:96] = rng.random((64, 64, 4)) > 0.5
    levels = [np.clip(level[0], 0, 1) for level in mips.mip_chain(level0, 5, filter)]
    stored = [np.round(level * 255) / np.float32(255) for level in levels]
    screen = thin_lens.Screen((64, 64), 300, 4)
    for number in range(1, 4):
        below, above = (thin_lens.looked_up(screen, stored, 32, number + d) for d in (-5e-5, 5e-5))
        assert np.abs(above - below).max() < 1 / 255


def test_fit_finds_the_scale_that_made_the_pictures(rng: np.random.Generator) -> None:
    c = float(lens_by_mips.SCALES[60])
    level0 = (rng.random((48, 48, 4)) > 0.5).astype(np.float32)
    scene = lens_by_mips.Scene(level0, (48, 48), {})
    levels = lens_by_mips.chain_of(scene, "box", 0.5)
    for pixels, blur in ((256, 2), (256, 5), (512, 9)):
        texels = thin_lens.CONTENT / pixels
        screen = thin_lens.Screen((48, 48), pixels, blur)
        lod = thin_lens.level_of(blur * texels, texels, c)
        scene.truth[pixels, blur] = thin_lens.looked_up(screen, levels, lens_by_mips.BORDER, lod)
    found, decibels = lens_by_mips.best_scale(dict(lens_by_mips.pairs_of("noise", scene, levels)))
    # The floor of a mean square, 1e-12, is 120 dB; single precision of the pictures costs some
    assert found == c
    assert decibels > 100


# the other truths


def test_error_of_coefficients_is_that_of_relit_pictures(rng: np.random.Generator) -> None:
    terms, truth = rng.standard_normal((2, 5, 6, 4, 3)).astype(np.float32)
    alpha = (rng.random((6, 4)) > 0.3).astype(np.float32)
    basis = circular_harmonics.evaluate(2 * np.pi * np.arange(64) / 64, 5)
    difference = np.einsum("mk,khwc->mhwc", basis, terms - truth)[:, alpha > 0]
    slow = float(np.sqrt(np.mean(difference**2)))
    assert light_directions.relit_error(terms, truth, alpha) == pytest.approx(slow, rel=1e-6)


def test_enough_is_where_no_subject_falls_short_any_more() -> None:
    def row(subject: str, directions: int, held_out: float) -> dict[str, float | int | str]:
        return {
            "subject": subject,
            "directions": directions,
            "held_out_db": held_out,
            "held_out_of_truth_db": 30.0,
        }

    rows = [row("a", 8, 29.0), row("a", 16, 29.95), row("b", 8, 29.95), row("b", 16, 29.96)]
    assert light_directions.enough_of(rows) == 16


def test_ring_model_is_the_basis_on_the_ring_and_fades_towards_its_axis() -> None:
    master = subjects.traced(quad(), resolution=8, samples=1, lights=8, held_out=2)
    angles = np.array([0.3, 2.0])
    here = circular_harmonics.ring_direction(angles, "view", master.ring.elevation)
    basis = circular_harmonics.evaluate(angles, 5)
    np.testing.assert_allclose(ring_models.model(master, here), basis, atol=1e-12)
    higher = circular_harmonics.ring_direction(angles, "view", np.radians(75))
    np.testing.assert_allclose(ring_models.on_ring(master, higher), basis, atol=1e-12)
    g = np.cos(np.radians(75)) / np.cos(master.ring.elevation)
    faded = basis * g ** np.array([0, 1, 1, 2, 2])
    np.testing.assert_allclose(ring_models.model(master, higher), faded, atol=1e-12)


def test_ring_models_are_exact_for_a_plane_on_its_own_ring() -> None:
    master = subjects.traced(
        quad(), resolution=16, samples=1, lights=16, held_out=4, sun_diameter=0.0
    )
    angles = np.asarray(master.held_out_angles)
    light = circular_harmonics.evaluate(angles, 5)
    # A plane that faces the ring's axis is lit alike from all around: the terms hold that
    relit = ring_models.relit_by(master, light)
    np.testing.assert_allclose(relit, master.held_out, rtol=2e-6)


def test_rays_of_a_plane_are_counted() -> None:
    params = billboard.Params(resolution=16, samples=4, lights=32, held_out=0)
    recorder = ray_calls.cast(quad(), params, keep=True)
    # Every camera ray hits, every hit faces all of its 32 / 4 lights, and nothing is transparent
    camera = 16 * 16 * 4
    assert recorder.rays == camera + camera * 8
    assert sum(len(c.origins) for tile in recorder.tiles for c in tile) == recorder.rays


def test_replay_casts_the_same_rays() -> None:
    recorder = ray_calls.cast(
        quad(), billboard.Params(resolution=8, samples=2, lights=16), keep=True
    )
    again = ray_calls.Recorder(recorder.scene, keep=False)
    ray_calls.replay(ray_calls.Recorder(again, keep=False, tiles=recorder.tiles))
    assert again.rays == recorder.rays


def test_knot_is_closed_and_looks_outward() -> None:
    mesh = meshes.knot(60, 12)
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert set(uses.tolist()) == {2}
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


# running them


# Those that take longest have tests of their own, on less
OWN = {
    "lens_by_mips",
    "gather_lights",
    "gather_modes",
    "importance",
    "lightmap_texels",
    "voxel_storage",
    "shadow_truth",
    "shadow_lights",
    "sprite_lights",
    "mesh_lights",
}


@pytest.mark.slow
@pytest.mark.parametrize("question", [q for q in run.QUESTIONS if q not in OWN])
def test_study_answers_and_writes_it_down(question: str, tmp_path: Path) -> None:
    setting = QUICK if "mesh" in run.takes(question) else subjects.Setting(quick=True)
    answer, files = run.run_one(question, tmp_path, setting)
    assert sorted(f.suffix for f in files[:4]) == [".csv", ".json", ".png", ".svg"]
    assert all(f.stem == question for f in files[:4])
    assert [f.stem for f in files[4:]] == [f"{question}-{name}" for name in answer.pictures]
    assert all(f.stat().st_size > 0 for f in files)
    data = json.loads((tmp_path / f"{question}.json").read_text())
    assert data["answer"] == answer.title
    assert data["source"] == (None if setting.source is None else "lantern.glb")
    assert {"machine", "versions", "seed", "truth"} <= set(data)
    with open(tmp_path / f"{question}.csv", encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == len(data["rows"]) > 0
    check_form(answer)


def check_form(answer: Answer) -> None:
    """Every point is in the common form, is told apart, and has its picture."""
    points = answer.points
    assert points
    assert len({(p["subject"], p["setting"]) for p in points}) == len(points)
    assert answer.columns()
    assert set(answer.shots) == {(p["subject"], p["setting"]) for p in points}
    for each in points:
        assert float(each["error_low"]) <= float(each["error"]) <= float(each["error_high"])
        assert all(float(each[price]) > 0 for price in PRICES if price in each)
    for shot in answer.shots.values():
        assert shot.truth is not None
        assert shot.picture.shape == shot.truth.shape
        assert shot.picture.dtype == shot.truth.dtype == np.uint8


def test_questions_are_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run.run(("list",), tmp_path, quick=True, source=None)
    listed = capsys.readouterr().out
    assert all(question in listed for question in run.QUESTIONS)
    assert list(tmp_path.iterdir()) == []


def test_unknown_question_and_source_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="packing"):
        run.run(("pakcing",), tmp_path, quick=True, source=None)
    with pytest.raises(InputError, match="no such file"):
        run.run(("packing",), tmp_path, quick=True, source=tmp_path / "none.glb")


def test_verdicts_follow_the_aims() -> None:
    assert bench.Figure("a", 1.0, "s", 2.0).verdict == "met"
    assert bench.Figure("a", 2.0, "s", 2.0).verdict == "MISSED"
    assert bench.Figure("a", 2.0, "s").verdict == ""


def test_peak_memory_is_that_of_this_process() -> None:
    before = bench.peak_bytes()
    held = np.ones(40_000_000, np.uint8)
    # The peak may have been higher before, so it need not grow; it cannot be below what is held
    assert bench.peak_bytes() >= max(before, held.nbytes)


def test_a_mesh_of_the_user_stands_on_the_ground_in_any_scene(tmp_path: Path) -> None:
    source = tmp_path / "my mesh (1).off"
    source.write_text("OFF\n5 1 0\n990 50 7\n1010 50 7\n990 90 7\n9999 0 0\n0 0 0\n3 0 1 2\n")
    found = subjects.placed(subjects.Setting(source=source), "bust.glb", tmp_path / "a", 0.5)
    mesh = meshes.source(found).load()
    used = mesh.vertices[np.unique(mesh.faces)]
    np.testing.assert_allclose(used.min(axis=0), [-0.125, 0, 0], atol=1e-6)
    np.testing.assert_allclose(used.max(axis=0), [0.125, 0.5, 0], atol=1e-6)
    own = subjects.placed(subjects.Setting(), "bust.glb", tmp_path / "a", 0.5)
    assert own.read_bytes() == (subjects.MESHES / "bust.glb").read_bytes()
