"""Light projected on terms, in turns: the interleaved sum against the full one."""

from dataclasses import replace

import numpy as np
import pytest

from bake import billboard, gather
from bake.billboard import Params, lights_of, trace
from formats.mesh import Material
from maths import circular_harmonics
from tests.bake import small_meshes


def test_turns_keep_enough_lights_and_divide_both():
    for lights in (1, 7, 16, 61, 64, 96, 256):
        for samples in (1, 3, 16, 64):
            for terms in (1, 5, 9):
                m = gather.turns_of(lights, samples, terms)
                assert lights % m == 0
                assert samples % m == 0
                assert m == 1 or lights // m >= max(8, 2 * (terms - 1))


@pytest.mark.parametrize(
    ("arguments", "turns"),
    [((64, 16, 5), 8), ((64, 16, 9), 4), ((64, 1, 5), 1), ((61, 16, 5), 1), ((64, 16, 5, 64), 1),
     ((64, 16, 5, 32), 2), ((4, 16, 5), 1), ((256, 64, 5), 32)],
)  # fmt: skip
def test_turns_by_hand(arguments, turns):
    assert gather.turns_of(*arguments) == turns


@pytest.mark.parametrize("turns", [1, 2, 8])
def test_every_turn_sees_its_own_evenly_spaced_lights(turns):
    lights, samples = 64, 16
    seen = np.zeros((lights, samples), int)
    for which, subsamples in gather._blocks(lights, turns, samples):
        assert len(which) <= gather.BLOCK
        seen[np.ix_(which, subsamples)] += 1
    assert (seen.sum(axis=0) == lights // turns).all()
    assert (seen.sum(axis=1) == samples // turns).all()
    for s in range(samples):
        assert set(np.flatnonzero(seen[:, s]) % turns) == {-s % turns}


def projected(signal, turns, *, lights=64, samples=16, terms=5):
    """What `gather` makes of subsamples whose radiance under azimuth t is signal(t, s)."""
    angles = 2 * np.pi * np.arange(lights) / lights
    matrix = circular_harmonics.fit_weights(angles, terms).matrix
    total = np.zeros(terms)
    for which, subsamples in gather._blocks(lights, turns, samples):
        for s in subsamples:
            total += matrix[:, which] @ signal(angles[which], s) * turns / samples
    return total


@pytest.mark.parametrize("turns", [2, 4, 8])
@pytest.mark.parametrize("terms", [3, 5])
def test_turns_are_exact_below_the_stated_harmonic(turns, terms, rng):
    """Subsamples of different signals, each without harmonics >= N / m - H: nothing is lost."""
    highest = 64 // turns - terms // 2 - 1
    coefficients = rng.normal(size=(16, 2 * highest + 1))

    def signal(t, s):
        return circular_harmonics.evaluate(t, 2 * highest + 1) @ coefficients[s]

    full = projected(signal, 1, terms=terms)
    # float64 sums of 64 terms of order 1
    np.testing.assert_allclose(projected(signal, turns, terms=terms), full, rtol=0, atol=1e-13)
    np.testing.assert_allclose(full, coefficients.mean(axis=0)[:terms], rtol=0, atol=1e-13)


def test_the_first_harmonic_beyond_is_the_first_to_be_lost():
    """Harmonic N / m - 2 of one subsample lands on harmonic 2; harmonic N / m - 3 does not."""

    def signal(harmonic):
        return lambda t, s: np.cos(harmonic * t) * (s == 3)

    # N / m = 8: cos 6t looks like cos 2t to one subsample, of which there are 16
    assert np.hypot(*projected(signal(6), 8)[3:]) == pytest.approx(np.sqrt(np.pi) / 16, abs=1e-13)
    assert np.abs(projected(signal(5), 8)).max() < 1e-13
    assert np.abs(projected(signal(6), 1)).max() < 1e-13


@pytest.fixture(scope="module")
def still_life():
    """A sphere and a leaf over a slab, with their shadows on one another."""
    leaf = Material(base_color=(0.3, 0.6, 0.2), double_sided=True)
    return small_meshes.joined(
        small_meshes.sphere(24, 48),
        small_meshes.box((1.6, 0.1, 1.2), (0, -1.1, 0)),
        small_meshes.plate((1, 1, 1), (0.9, 0.8, 0.6), 0.5, leaf),
    )


def test_turns_against_all_lights_on_a_mesh(still_life):
    """m = 8 casts an eighth of the rays; what that adds to the coefficients stays small."""
    full = trace(still_life, params=Params(resolution=64, lights_per_sample=64))
    turned = trace(still_life, params=Params(resolution=64))
    assert turned.quality["lights_per_sample"] == 8
    assert full.quality["lights_per_sample"] == 64
    covered = full.alpha[0] > 0
    error = np.sqrt(np.mean(np.square(turned.terms - full.terms)[0][:, covered]))
    signal = np.sqrt(np.mean(np.square(full.terms)[0][:, covered]))
    # Measured 1.7 % of the signal's RMS, all of it at shadows' edges: 16 subsamples at all lights
    # are themselves 1.7 % off 64 of them
    assert error < 0.025 * signal
    # It costs under .1 dB against renders that neither has seen (measured .02)
    assert turned.quality["held_out_psnr"] > full.quality["held_out_psnr"] - 0.1


def test_the_held_out_renders_are_what_a_ring_at_their_azimuths_would_render(still_life):
    """A ring of one light per held-out azimuth, fitted by none: direct against streamed."""
    params = Params(resolution=24, lights=16, samples=4, lights_per_sample=16, sky_fill=0.4)
    lights = lights_of(params)
    master = trace(still_life, params=params)
    # Swap the roles: light the mesh by the held-out directions, and read the terms of each alone
    many = replace(
        lights,
        ring=lights.held,
        matrix=np.eye(len(lights.held)) * np.sqrt(2 * np.pi),
        turns=1,
        sky=lights.sky[:0],
    )
    surface = billboard.Surface(
        still_life, billboard.RayScene(still_life.vertices, still_life.faces), 0.35, 0.0
    )
    frame = billboard.frame_of(still_life, params)
    span = (0, 0, frame.width * frame.height)
    tile = billboard._tile(surface, frame, many, params, span)
    chosen = np.isin(tile.texels, master.held_out_texels)
    alone = tile.gathered.terms[:, chosen] / np.float32(np.sqrt(2 * np.pi))
    with_sky = billboard._tile(surface, frame, lights, params, span).gathered.terms
    dark = billboard._tile(surface, frame, replace(lights, sky=lights.sky[:0]), params, span)
    sky = (with_sky - dark.gathered.terms)[0, chosen] / np.float32(np.sqrt(2 * np.pi))
    # The same float32 numbers in other orders: sums of 4 subsamples and of 64 sky directions
    np.testing.assert_allclose(master.held_out, alone + sky, rtol=0, atol=2e-6)
    assert sky.max() > 0.01


def test_mean_square_and_kept_energy_are_those_of_the_signal():
    """A whole plate, whose signal is known: max(0, A + B cos t) / pi."""
    sheet = small_meshes.plate((0.8, 0, 0.6))
    params = Params(resolution=8, sun_diameter=0.0)
    surface = billboard.Surface(sheet, billboard.RayScene(sheet.vertices, sheet.faces), 0.0, 0.0)
    frame = billboard.frame_of(sheet, params)
    span = (0, 0, frame.width * frame.height)
    tile = billboard._tile(surface, frame, lights_of(params), params, span)
    whole = tile.alpha == 1
    t = 2 * np.pi * np.arange(64) / 64
    X = np.maximum(0, 0.6 * 0.5 + 0.8 * np.sqrt(0.75) * np.cos(t)) / np.pi
    Y = circular_harmonics.fit_weights(t, 5).matrix @ X
    assert np.count_nonzero(whole) > 20
    # Float32: relative 2^-24 for each of 64 lights at worst
    np.testing.assert_allclose(tile.gathered.squares[whole], np.mean(X**2), rtol=64 * 2.0**-24)
    np.testing.assert_allclose(tile.gathered.kept[whole], Y @ Y / (2 * np.pi), rtol=4e-6)
