"""Coefficients of three tiny sprites, baked here and compared with committed ones.

What is physically right is tested elsewhere, against closed forms; this finds what changed without
anyone meaning it. After a change that is meant, `BAKELIGHT_REGENERATE=1` writes the files anew (see
CONTRIBUTING), and the changelog says why.
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bake.billboard import Params, trace
from formats.files import image
from formats.mesh import Material
from tests.bake import small_meshes

HERE = Path(__file__).parent
SAMPLES, LIGHTS = 8, 32
COMMON = Params(resolution=32, samples=SAMPLES, lights=LIGHTS, sun_diameter=0.05, held_out=0)


def ball_on_slab():
    """Self-shadowing, smooth and flat faces, two materials; ring about the view."""
    grey = Material(base_color=(0.5, 0.5, 0.5))
    red = Material(base_color=(0.8, 0.3, 0.1))
    slab = replace(small_meshes.box((1.5, 0.1, 1.5), (0, -1.1, 0)), materials=(grey,))
    return small_meshes.joined(small_meshes.sphere(16, 32, red), slab), COMMON


def leaf_pair():
    """Light through thin sheets and from the sky; ring about the up axis, two views."""
    leaf = Material(base_color=(0.2, 0.5, 0.1), double_sided=True)
    front = small_meshes.plate((1, 1, 2), (0.2, 1.0, 0.4), 0.8, leaf)
    back = small_meshes.plate((-1, 0.5, 1), (-0.3, 0.6, -0.3), 0.9, leaf)
    params = replace(COMMON, axis="up", elevation=0.6, views=2, transmission=0.4, sky_fill=0.3)
    return small_meshes.joined(front, back), params


def painted_cube():
    """Texture and vertex colours, gloss, a near eye; nine terms, every light at every sample."""
    cube = small_meshes.box()
    turn = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    squares = np.indices((8, 8)).sum(axis=0) % 2
    texture = np.where(squares[..., None], [0.9, 0.7, 0.2], [0.2, 0.3, 0.8]).astype(np.float32)
    painted = replace(
        small_meshes.mesh_of(cube.vertices @ turn.T, cube.faces),
        materials=(Material(base_color=(0.9, 0.9, 0.9), texture=texture, roughness=0.4),),
        uv=(cube.vertices[:, :2] * 0.5 + 0.5 * cube.vertices[:, 2:]).astype(np.float32),
        colours=(0.6 + 0.4 * cube.vertices * [1, -1, 1]).clip(0, 1).astype(np.float32),
    )
    params = replace(COMMON, gloss=0.8, field_of_view=0.7, terms=9, lights_per_sample=LIGHTS)
    return painted, params


SPRITES = {"ball_on_slab": ball_on_slab, "leaf_pair": leaf_pair, "painted_cube": painted_cube}


def compare(terms, alpha, expected, folder):
    """Assert that coefficients are the expected ones, up to float32 and to a few rays.

    Sums of 32 lights and 8 subsamples, taken in another order, differ by 40 roundings of the
    largest number. A ray that meets an edge within its rounding may go the other way where Embree
    uses other instructions: it is one subsample of a texel, and few texels have one.
    """
    assert terms.shape == expected["terms"].shape
    assert alpha.shape == expected["alpha"].shape
    difference = np.abs(terms - expected["terms"]).max(axis=(1, 4))
    peak = float(np.abs(expected["terms"]).max())
    changed = difference > 40 * 2.0**-24 * peak
    worst = max(difference.max() / peak, np.abs(alpha - expected["alpha"]).max())
    share = np.count_nonzero(changed) / np.count_nonzero(expected["alpha"])
    if share > 0.01 or worst > 2 / SAMPLES:
        for name, picture in {
            "expected.png": expected["terms"][0, 0],
            "found.png": terms[0, 0],
            "difference_x8.png": 8 * np.abs(terms - expected["terms"])[0, 0],
        }.items():
            image.write(folder / name, np.clip(picture / peak, 0, 1))
    assert share <= 0.01, f"{share:.1%} of the texels changed: pictures in {folder}"
    assert worst <= 2 / SAMPLES, f"a texel changed by {worst:.0%}: pictures in {folder}"


@pytest.mark.parametrize("name", SPRITES)
def test_coefficients_are_the_committed_ones(name, tmp_path):
    mesh, params = SPRITES[name]()
    master = trace(mesh, params=params)
    path = HERE / f"{name}.npz"
    if os.environ.get("BAKELIGHT_REGENERATE") == "1":
        np.savez_compressed(path, terms=master.terms, alpha=master.alpha)
        pytest.skip(f"{path.name} is written anew")
    with np.load(path, allow_pickle=False) as expected:
        compare(master.terms, master.alpha, dict(expected), tmp_path)


CHANGES = {
    "a light 0.2 % brighter": lambda terms: terms * np.float32(1.002),
    "a term with the other sign": lambda terms: (
        terms * np.array([1, 1, -1, 1, 1])[:, None, None, None]
    ),
    "a sprite shifted by a texel": lambda terms: np.roll(terms, 1, axis=3),
    "channels swapped": lambda terms: terms[..., ::-1],
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_the_comparison_sees_changes(change, tmp_path):
    with np.load(HERE / "ball_on_slab.npz", allow_pickle=False) as file:
        expected = dict(file)
    compare(expected["terms"], expected["alpha"], expected, tmp_path)
    with pytest.raises(AssertionError, match="pictures in"):
        compare(change(expected["terms"]), expected["alpha"], expected, tmp_path)
    assert len(list(tmp_path.glob("*.png"))) == 3


def test_a_knob_turned_by_a_percent_is_seen(tmp_path):
    mesh, params = leaf_pair()
    turned = trace(mesh, params=replace(params, transmission=0.404))
    with np.load(HERE / "leaf_pair.npz", allow_pickle=False) as file:
        expected = dict(file)
    with pytest.raises(AssertionError, match="pictures in"):
        compare(turned.terms, turned.alpha, expected, tmp_path)
