"""Lights at a moment, and their projection for sets of sprites."""

from __future__ import annotations

import numpy as np
import pytest

from formats import scene as scenes
from formats.billboard import Ring
from maths import circular_harmonics, hemispherical_lights, transforms
from runtime import lighting
from runtime.dome_series import DomeSeries
from tests.runtime import domes

VIEW = Ring(axis="view", elevation=0.5, terms=5, one_sided=False)
UP = Ring(axis="up", elevation=0.3, terms=7, one_sided=False)


def series_of(kind):
    """How a ring, or the small dome, counts light."""
    if kind == "dome":
        return DomeSeries(domes.matt_ball(size=16))
    return lighting.RingSeries(kind)


every_kind = pytest.mark.parametrize("kind", [VIEW, UP, "dome"], ids=["view", "up", "dome"])


def suns_of(*directions):
    return lighting.Lights(
        tuple(
            lighting.SunState(transforms.normalise(d), np.array([1.0, 2, 3]), 0.0)
            for d in directions
        ),
        (),
        (),
    )


@every_kind
def test_mirroring_the_series_mirrors_the_light(kind, rng):
    ring, projector = series_of(kind), lighting.SpriteLighting()
    centres, flip = np.zeros((2, 3)), np.array([False, True])
    x, y, z = np.abs(rng.normal(size=3))
    rows, index = projector.project(suns_of([x, y, z]), ring, 0.0, centres, flip)
    mirrored, _ = projector.project(suns_of([-x, y, z]), ring, 0.0, centres, flip)
    np.testing.assert_allclose(rows[index[1]], mirrored[index[0]], atol=1e-12)


@every_kind
@pytest.mark.parametrize("yaw", [0.0, 1.3, -2.9])
def test_the_camera_and_the_world_turned_together_change_nothing(kind, yaw, rng):
    ring, projector = series_of(kind), lighting.SpriteLighting()
    direction, ball = rng.normal(size=3), rng.normal(size=3) * 3
    direction[2], ball[2] = abs(direction[2]), abs(ball[2])
    turn = transforms.rotation("y", yaw)

    def rows(by, at):
        lights = lighting.Lights(
            suns_of(by @ direction).suns,
            (lighting.SphereState(by @ ball, 0.3, np.ones(3)),),
            (),
        )
        return projector.project(lights, ring, at, np.zeros((1, 3)), np.array([False]))[0]

    np.testing.assert_allclose(rows(turn, yaw), rows(np.eye(3), 0.0), atol=1e-12)


@pytest.mark.parametrize("ring", [VIEW, UP])
def test_a_map_seen_from_any_yaw_is_projected_as_if_afresh(ring, rng):
    projector = lighting.SpriteLighting()
    radiance = rng.uniform(0, 1, (16, 32, 3))
    projector.take({2: radiance})
    for yaw, rotate in ((0.0, 0.0), (0.7, 0.0), (0.7, -1.1), (-2.0, 0.4)):
        state = lighting.EnvironmentState(2, np.array([1.0, 0.5, 2.0]), rotate)
        lights = lighting.Lights((), (), (state,))
        series = lighting.RingSeries(ring)
        rows, _ = projector.project(lights, series, yaw, np.zeros((1, 3)), np.array([False]))
        expected = circular_harmonics.project_environment(
            radiance, ring.terms, axis=ring.axis, elevation=ring.elevation, yaw=yaw - rotate
        )
        # 32 texels a row: the ring's own harmonics are exact, off it the gain's kink is not
        np.testing.assert_allclose(
            rows[0], expected * state.factor, atol=2e-3 * np.abs(expected).max()
        )


def test_a_dome_keeps_a_map_for_one_yaw_at_a_time(rng):
    asset, projector = domes.matt_ball(size=16), lighting.SpriteLighting()
    radiance = rng.uniform(0, 1, (16, 32, 3))
    projector.take({2: radiance})
    state = lighting.EnvironmentState(2, np.array([1.0, 0.5, 2.0]), 0.4)
    for yaw in (0.0, 0.7, 0.7, -2.0):
        lights = lighting.Lights((), (), (state,))
        series = DomeSeries(asset)
        rows, index = projector.project(lights, series, yaw, np.zeros((2, 3)), np.arange(2) > 0)
        seen = hemispherical_lights.project_environment(radiance, 4, yaw=yaw - 0.4)
        np.testing.assert_allclose(rows[0], asset.constants(seen * state.factor), atol=1e-12)
        assert rows.shape == (2, 15, 3)
        assert index.tolist() == [0, 1]
        assert len(projector._kept) == 1


def test_shares_of_suns_and_balls_light_each_sprite_of_a_dome(rng):
    asset, projector = domes.matt_ball(size=16), lighting.SpriteLighting()
    suns = suns_of([0.3, 0.5, 0.8])
    ball = lighting.SphereState(np.array([0.0, 1.0, 2.0]), 0.3, np.array([3.0, 2.0, 1.0]))
    lights = lighting.Lights(suns.suns, (ball,), ())
    centres, flip = rng.normal(size=(3, 3)) * 0.3, np.array([False, True, False])
    share = np.array([1.0, 0.5, 0.0])
    rows, index = projector.project(lights, DomeSeries(asset), 0.0, centres, flip, [share])
    signs = hemispherical_lights.mirror_signs(4)[:, None]
    for i in range(3):
        sun = hemispherical_lights.project_sun([0.3, 0.5, 0.8], suns.suns[0].irradiance, 4)
        offset = ball.position - centres[i]
        seen = share[i] * sun + hemispherical_lights.project_sphere(offset, 0.3, ball.radiance, 4)
        expected = asset.constants(seen * signs if flip[i] else seen)
        np.testing.assert_allclose(rows[index[i]], expected, atol=1e-12)


def test_shrinking_a_map_keeps_its_light(rng):
    radiance = rng.uniform(0, 1, (128, 256, 3))
    small = lighting.shrunk(radiance)
    assert small.shape == (32, 64, 3)
    for image in (small, radiance):
        h, w, _ = image.shape
        power = (image * transforms.latlong_solid_angles(h, w)[:, None, None]).sum(axis=(0, 1))
        np.testing.assert_allclose(power, 2 * np.pi * 2 * 0.5 * np.ones(3), rtol=0.02)
        if image is small:
            kept = power
    np.testing.assert_allclose(power, kept, rtol=1e-12)


def test_irradiance_of_an_even_sky_is_pi():
    np.testing.assert_allclose(
        lighting.irradiance_from_above(np.ones((7, 3, 3))), np.pi, rtol=1e-12
    )
    upper = np.zeros((8, 4, 3))
    upper[:4] = 2.0
    np.testing.assert_allclose(lighting.irradiance_from_above(upper), 2 * np.pi, rtol=1e-12)


@pytest.mark.parametrize(("degrees", "share"), [(-1.0, 0.0), (0.0, 0.5), (1.0, 1.0)])
def test_a_disc_sets_behind_the_horizon(degrees, share):
    e = np.radians(degrees)
    found = lighting.above_horizon(np.array([np.cos(e), np.sin(e), 0]), np.radians(0.9))
    assert found == pytest.approx(share, abs=1e-9)


def test_half_a_radius_up_a_segment_is_missing():
    # Area of a circle's segment beyond half the radius: 1/3 - sqrt(3) / (4 pi) of the disc
    e = np.radians(0.5)
    found = lighting.above_horizon(np.array([np.cos(e), np.sin(e), 0]), np.radians(1.0))
    assert found == pytest.approx(1 - (1 / 3 - np.sqrt(3) / (4 * np.pi)), abs=1e-6)


def test_the_first_sun_turns_for_a_viewer(kit):
    raw = kit.scene_dict(
        lights=[{"type": "sun", "to_light": [0, 0, 2], "irradiance": [1, 1, 1]}] * 2
    )
    scene = scenes.from_dict(raw, where="s.toml", root=None)
    lights = lighting.at(scene, 0.0, (np.pi / 2, np.pi / 6))
    expected = [np.cos(np.pi / 6), 0.5, 0]
    np.testing.assert_allclose(lights.suns[0].to_light, expected, atol=1e-12)
    np.testing.assert_allclose(lights.suns[1].to_light, [0, 0, 1])


def test_suns_set_only_where_there_is_a_ground(kit):
    sun = [{"type": "sun", "to_light": [1, -0.5, 0], "irradiance": [1, 1, 1]}]
    for ground, expected in (({}, 0.0), (None, 1.0)):
        raw = kit.scene_dict(lights=sun, ground=ground)
        scene = scenes.from_dict(raw, where="s.toml", root=None)
        assert lighting.at(scene, 0.0).suns[0].irradiance.max() == expected
