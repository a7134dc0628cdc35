"""Components of occlusion harmonics, and their codes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bake import compress, occlusion
from bake.compress import Params
from formats.errors import InputError
from formats.occlusion import Box, Occlusion, OcclusionHarmonics
from tests.bake import small_meshes, stage_battery

BOX = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
CUT = ("terms", "error", "proof_lights")


@pytest.fixture(scope="module")
def master() -> OcclusionHarmonics:
    mesh = small_meshes.box((1.0, 0.6, 0.3))
    return occlusion.trace(mesh, params=occlusion.Params(grid=10, rays=256, proof=64))


def small(terms: np.ndarray, inside: np.ndarray | None = None) -> OcclusionHarmonics:
    """A master of given terms (n, n, n, K), without proof."""
    n, K = terms.shape[0], terms.shape[-1]
    return OcclusionHarmonics(
        terms=terms.astype(np.float32),
        inside=np.zeros((n, n, n), bool) if inside is None else inside,
        spread=np.zeros((n, n, n), np.float32),
        error=np.zeros(K, np.float32),
        box=BOX,
        proof_voxels=np.zeros(0, np.int64),
        proof_lights=np.zeros((0, 0, K), np.float32),
        proof_shadow=np.zeros((0, 0, 0), np.float32),
    )


def restored(asset: Occlusion) -> np.ndarray:
    return np.asarray(asset.decoded() @ asset.basis)


def test_all_components_lose_only_what_codes_do(master: OcclusionHarmonics) -> None:
    for depth, step in ((8, 1 / 254), (16, 2.0**-11)):
        asset = compress.compress(master, params=Params(components=25, depth=depth))
        assert asset.volumes.shape == (7, 10, 10, 10, 4)
        error = np.abs(restored(asset) - master.terms).max()
        # Half a step of each component (2^-11 of a value is a half float's), the worst signs, and
        # float32 products
        worst = np.abs(asset.basis * asset.scales[:25, None]).sum(axis=0).max() * step
        assert error <= worst + 1e-5
        assert error > 0.01 * worst


def test_sixteen_keep_the_most_that_sixteen_can(master: OcclusionHarmonics) -> None:
    asset = compress.compress(master, params=Params(depth=16))
    terms = master.terms[~master.inside].astype(np.float64)
    error = restored(asset)[~master.inside] - terms
    s = np.linalg.svd(terms, compute_uv=False)
    # Eckart and Young, to half floats: values lose 2^-11 of themselves
    least = np.sqrt(np.sum(s[16:] ** 2) / terms.size)
    assert least > 0.01
    assert np.sqrt(np.mean(error**2)) == pytest.approx(least, rel=0.01)
    assert asset.quality["component_loss"] == pytest.approx(least, rel=1e-3)
    assert asset.quality["kept_energy"] == pytest.approx(np.sum(s[:16] ** 2) / np.sum(s**2))
    np.testing.assert_allclose(asset.basis @ asset.basis.T, np.eye(16), atol=1e-10)


def test_scores_are_rounded_once(rng: np.random.Generator) -> None:
    """Summed in double precision, so that codes do not depend on the kernel of BLAS."""
    terms, vectors = rng.normal(size=(300, 25)).astype(np.float32), rng.normal(size=(16, 25))
    exact = terms.astype(np.longdouble) @ vectors.T
    found = compress.scores_of(terms, vectors)
    # A rounding of 24 bits, and 25 of 53 bits before
    np.testing.assert_allclose(found, np.asarray(exact, np.float64), rtol=2.0**-24, atol=1e-13)


def test_nothing_hidden_stays_exactly_nothing(master: OcclusionHarmonics) -> None:
    terms = master.terms.copy()
    terms[0, 0, 0] = 0
    asset = compress.compress(replace(master, terms=terms), params=Params())
    assert np.all(asset.volumes[:, 0, 0, 0] == 128)
    assert np.all(restored(asset)[0, 0, 0] == 0)


def test_voxels_inside_have_no_say(master: OcclusionHarmonics) -> None:
    assert master.inside.any()
    spoilt = np.where(master.inside[..., None], np.float32(0.1), master.terms)
    one, two = (
        compress.compress(replace(master, terms=terms), params=Params())
        for terms in (spoilt, master.terms)
    )
    assert np.array_equal(one.basis, two.basis)


def test_constants_give_the_hidden_share(master: OcclusionHarmonics) -> None:
    asset = compress.compress(master, params=Params(components=13))
    light = np.random.default_rng(3).normal(size=(2, 25, 3))
    values = (asset.volumes.astype(np.float64) - 128) / 127
    slots = np.moveaxis(values, 0, 3).reshape(10, 10, 10, 16)
    weights = asset.constants(light)
    assert weights.shape == (2, 16, 3)
    found = np.einsum("zyxk,akc->azyxc", slots, weights)
    truth = np.einsum("zyxj,ajc->azyxc", restored(asset), light)
    # float32 decoding of values up to 2, weighted by 25 numbers of about 1
    np.testing.assert_allclose(found, truth, atol=1e-4)
    assert np.all(weights[:, 13:] == 0)


def test_shadows_are_judged_by_rays_of_their_own(master: OcclusionHarmonics) -> None:
    shadow = compress.compress(master, params=Params()).quality["shadow_rms"]
    assert shadow["degrees"].tolist() == [10, 20, 30, 45]
    floor, codes = shadow["harmonics"], shadow["codes"]
    # Small lights need bands that are not there: the error falls with the radius
    assert np.all(np.diff(floor) < 0)
    assert 0.05 < floor[0] < 0.2
    assert np.all(codes >= floor * 0.98)
    np.testing.assert_allclose(codes, shadow["components"], atol=0.003)
    # The truth itself has no error
    hidden = master.proof_lights @ master.terms.reshape(-1, 25)[master.proof_voxels].T
    exact = replace(master, proof_shadow=np.clip(1 - hidden, 0, 1))
    own = compress.shadow_rms(exact, {"harmonics": master.terms.reshape(-1, 25)})
    np.testing.assert_allclose(own["harmonics"], 0, atol=1e-6)


def test_bands_keep_every_harmonic_within_their_bytes(master: OcclusionHarmonics) -> None:
    for depth, size in ((8, 24), (16, 48)):
        asset = compress.compress(master, params=Params("bands", depth=depth, size=size))
        assert asset.coarse is not None
        assert 0.85 * size * 1024 < asset.nbytes <= size * 1024
        assert (len(asset.volumes), len(asset.coarse), asset.components) == (2, 5, 25)
        assert asset.quality["bytes"] == asset.nbytes
        np.testing.assert_array_equal(asset.basis, np.eye(25))
        # Half a step of each number's own range
        assert asset.quality["quantisation_loss"] < asset.scales.max() * 0.5 / 127
    voxels = master.box.to_object(master.box.voxel_centres(10))[~master.inside.ravel()]
    error = asset.terms(voxels) - master.terms[~master.inside]
    loss = np.hypot(asset.quality["component_loss"], asset.quality["quantisation_loss"])
    assert np.sqrt(np.mean(error**2)) == pytest.approx(loss, rel=0.05)


def test_bands_err_less_than_sixteen_components_of_the_same_bytes() -> None:
    mesh = small_meshes.box((1.0, 0.6, 0.3))
    params = occlusion.Params(grid=12, l_max=6, rays=256, proof=200)
    master = occlusion.trace(mesh, params=params)
    low = replace(master, **{name: getattr(master, name)[..., :25] for name in CUT})
    talk = compress.compress(low, params=Params())
    bands = compress.compress(master, params=Params("bands", size=talk.nbytes // 1024))
    ratio = bands.quality["shadow_rms"]["codes"] / talk.quality["shadow_rms"]["codes"]
    # Measured: .62, .47, .6, 1.0 of lights of 10 to 45 degrees
    assert np.all(ratio[:3] < [0.75, 0.65, 0.8])


def test_bands_of_a_mesh_and_of_its_mirror_image_mirror(master: OcclusionHarmonics) -> None:
    degree = np.floor(np.sqrt(np.arange(25))).astype(int)
    m = np.arange(25) - degree * (degree + 1)
    # x -> -x: what goes like cos m phi of odd m and like sin m phi of even m turns over
    sign = np.where(m < 0, -1.0, 1.0) * (-1.0) ** m
    terms = (master.terms[:, :, ::-1] * sign).astype(np.float32)
    flipped = replace(master, terms=terms, inside=master.inside[:, :, ::-1])
    one, two = (
        compress.compress(each, params=Params("bands", size=16)) for each in (master, flipped)
    )
    p = np.random.default_rng(1).uniform(-1, 1, (200, 3))
    mirrored = two.terms(p * [-1, 1, 1]) * sign
    # A code is rounded either way
    np.testing.assert_allclose(mirrored, one.terms(p), atol=2 * one.scales.max() / 127)


def test_few_bands_and_empty_space() -> None:
    asset = compress.compress(small(np.zeros((3, 3, 3, 4))), params=Params())
    assert asset.components == 4
    assert np.all(restored(asset) == 0)
    assert asset.quality["kept_energy"] == 1
    bands = compress.compress(small(np.zeros((3, 3, 3, 4))), params=Params("bands", size=1))
    assert bands.coarse is None
    assert np.all(bands.volumes == 128)
    one = compress.compress(small(np.ones((2, 2, 2, 1))), params=Params(components=1))
    assert asset.volumes.shape == (1, 3, 3, 3, 4)
    np.testing.assert_allclose(restored(one), 1, rtol=1e-6)


def test_all_inside_is_refused() -> None:
    solid = small(np.zeros((2, 2, 2, 4)), np.ones((2, 2, 2), bool))
    with pytest.raises(InputError, match="inside"):
        compress.compress(solid, params=Params())


@pytest.mark.parametrize(
    "params",
    [
        Params(components=0),
        Params(components=65),
        Params(depth=12),
        Params("zonal"),
        Params("bands", size=0),
    ],
)
def test_knobs_out_of_range_are_refused(params: Params) -> None:
    with pytest.raises(InputError):
        compress.compress(small(np.zeros((2, 2, 2, 4))), params=params)


SMALL = occlusion.trace(
    small_meshes.sphere(4, 6), params=occlusion.Params(grid=4, l_max=1, rays=32, proof=2)
)


@pytest.mark.parametrize("case", stage_battery.cases(SMALL), ids=str)
@pytest.mark.parametrize("encoding", compress.ENCODINGS)
def test_battery(case: stage_battery.Case, encoding: str, tmp_path: Path) -> None:
    stage_battery.check(case, compress.compress, (SMALL,), Params(encoding), tmp_path)
