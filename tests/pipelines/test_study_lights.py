"""The studies of many suns on sprites and of a caster's points: closed forms, on little things."""

import numpy as np
import pytest

from bake import dome_renders
from formats.occlusion import Box
from maths.spherical_harmonics import turn_zonal
from maths.spherical_projection import cap
from pipelines.studies import caster_points, sprite_lights
from tests.bake import small_meshes
from tests.pipelines.test_study_normal_map import ALBEDO, quad

BOX = Box((0.0, 1.0, 0.0), (0.5, 1.0, 0.25))


def test_points_stand_on_the_longest_axes() -> None:
    line = caster_points.points_of(BOX, (4, 1)).reshape(-1, 3)
    np.testing.assert_allclose(line[:, 1], [0, 2 / 3, 4 / 3, 2])
    assert np.all(line[:, [0, 2]] == 0)
    corners = caster_points.points_of(BOX, (2, 2)).reshape(-1, 3)
    assert {tuple(p) for p in corners} == {(x, y, 0.0) for x in (-0.5, 0.5) for y in (0.0, 2.0)}
    assert caster_points.points_of(BOX, (1, 1)).reshape(-1).tolist() == [0, 1, 0]


@pytest.fixture(scope="module")
def ball() -> caster_points.Scene:
    return caster_points.scene_of(small_meshes.sphere(32, 48), 12)


def test_truth_of_a_small_far_lamp_is_the_ball_s_shadow(ball: caster_points.Scene) -> None:
    radius = float(max(ball.box.half_extent))
    lamp = np.asarray(ball.box.centre) + np.array([0.0, 400 * radius, 0.0])
    found = caster_points.traced(ball, lamp, 0.01 * radius, 8)
    away = np.linalg.norm((ball.floor - ball.box.centre)[:, [0, 2]], axis=1)
    clear, dark = away > 1.03 * radius, away < 0.97 * radius
    assert clear.sum() > 20
    assert dark.sum() > 10
    assert np.all(found[clear] == 1)
    assert np.all(found[dark] == 0)


def test_far_lamps_are_alike_from_all_points(ball: caster_points.Scene) -> None:
    lamp, radius = caster_points.placed(ball.box, np.array([1.0, 1.0, 0.5]), 2000.0)
    own = caster_points.shadow(ball, lamp, radius, caster_points.OWN)
    for way in caster_points.WAYS:
        # Within a two-thousandth of the direction, over harmonics up to 7
        apart = caster_points.shadow(ball, lamp, radius, way) - own
        assert np.abs(apart).max() < 0.02, way


def test_occlusion_of_the_ball_is_a_cap(ball: caster_points.Scene) -> None:
    radius = float(max(ball.box.half_extent))
    offset = np.asarray(ball.box.centre) - ball.floor
    away = np.linalg.norm(offset, axis=1)
    expected = turn_zonal(cap(np.arcsin(radius / np.maximum(away, 1.001 * radius)), 7), offset)
    outside = away > 1.1 * radius
    # The mesh lies up to 1 % within the ball; 1,024 rays
    assert np.abs(ball.hidden - expected)[outside].max() < 0.06


def test_suns_cover_the_hemisphere_and_are_the_same_again() -> None:
    for count in (1, 10, 1000):
        found = np.array(sprite_lights.suns(count))
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, atol=1e-12)
        assert found[:, 2].min() >= 0.1
    lamps = sprite_lights.lamps(300)
    assert len(lamps) == 300
    total = sum(float(np.sum(lamp.irradiance.at(0.0))) for lamp in lamps)
    assert total == pytest.approx(3 * sprite_lights.IRRADIANCE)


def test_the_mean_of_suns_is_that_of_single_ones() -> None:
    towards = sprite_lights.suns(150)
    found = sprite_lights.truth(quad(), towards, 8).pictures[0]
    params = dome_renders.Params(resolution=8, samples=4, directions=towards)
    slow = dome_renders.render(quad(), params=params).pictures.mean(axis=0)
    np.testing.assert_allclose(found, slow, rtol=1e-5)
    # A plane that faces the viewer takes the cosine
    expected = np.mean([z for *_, z in towards]) * np.array(ALBEDO)
    # The sun's disc and 4 rays a texel
    np.testing.assert_allclose(found[4, 4], expected, rtol=1e-3)


def test_relit_suns_add_up_before_the_clamp() -> None:
    methods = sprite_lights.baked(quad(), 12)
    towards = np.array(sprite_lights.suns(20))
    for name, relit in methods.items():
        # A plane is lit by all of them: nothing is below 0, and the sum is that of single ones
        single = np.mean([relit(each) for each in towards], axis=0)
        np.testing.assert_allclose(relit(towards), single, atol=2e-5, err_msg=name)
