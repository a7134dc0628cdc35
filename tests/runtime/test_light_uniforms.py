"""Lights as shaders take them: as many of each kind as the flags say, corners padded."""

from __future__ import annotations

import numpy as np

from formats import scene as scenes
from runtime import light_uniforms, lighting

LIGHTS = [
    {"type": "sun", "to_light": [0, 1, 0], "irradiance": [1, 1, 1]},
    {"type": "sphere", "position": [0, 2, 0], "radius": 0.5, "radiance": [4, 4, 4]},
    {"type": "disc", "position": [1, 2, 3], "facing": [0, -2, 0], "radius": 0.5,
     "radiance": [1, 2, 3], "two_sided": True},
    {"type": "rectangle", "position": [0, 3, 0], "facing": [0, 0, 1], "size": [2, 4],
     "radiance": [1, 1, 1]},
    {"type": "polygon", "outline": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "radiance": [5, 6, 7],
     "offset": {"times": [0, 1], "values": [[0, 0, 0], [0, 0, 2]]}},
    {"type": "environment", "source": "e.hdr"},
]  # fmt: skip


def scene_of(lights):
    raw = {
        "format": 1,
        "camera": {"position": [0, 1, 5], "target": [0, 1, 0]},
        "lights": lights,
    }
    return scenes.from_dict(raw, where="a.toml", root=None)


def test_flags_count_each_kind_and_the_arrays_have_that_length():
    scene = scene_of(LIGHTS)
    counts = light_uniforms.counts(scene)
    assert counts == {"SUNS": 1, "SPHERES": 1, "DISCS": 1, "POLYGONS": 2, "POLYGON_CORNERS": 4}
    values = light_uniforms.of(lighting.at(scene, 0.5))
    assert len(values["disc_place"]) == 1
    assert len(values["polygon_corner"]) == 2 * counts["POLYGON_CORNERS"]
    fronts = [[0, 0, 1, 20**0.5], [0, 0, 1, 1]]
    np.testing.assert_allclose(values["polygon_front"], fronts, atol=1e-12)
    np.testing.assert_allclose(values["polygon_light"], [[1, 1, 1, 0], [5, 6, 7, 0]])


def test_corners_are_those_of_the_polygon_that_has_most():
    turn = np.linspace(0, 2 * np.pi, 7)[:-1]
    hexagon = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    scene = scene_of([*LIGHTS, {"type": "polygon", "outline": hexagon.tolist(),
                                "radiance": [1, 1, 1], "two_sided": True}])  # fmt: skip
    assert light_uniforms.counts(scene)["POLYGON_CORNERS"] == 6
    values = light_uniforms.of(lighting.at(scene, 0.5))
    corners = np.reshape(values["polygon_corner"], (3, 6, 3))
    np.testing.assert_allclose(corners[2], hexagon, atol=1e-12)
    np.testing.assert_allclose(corners[1, 3:], [[0, 0, 1]] * 3)
    np.testing.assert_allclose(values["polygon_front"][2], [0, 0, 1, 2], atol=1e-12)
    assert values["polygon_light"][2][3] == 1


def test_a_sun_on_a_level_plane_is_cut_off_by_its_horizon():
    sun = {"type": "sun", "irradiance": [3, 2, 1]}
    high = {**sun, "to_light": [0, 0.6, 0.8]}
    low = {**sun, "to_light": [1, 0, 0], "angular_diameter": 90}
    values = light_uniforms.of(lighting.at(scene_of([high, low]), 0.0))
    np.testing.assert_allclose(values["sun_level"][0], [1.8, 1.2, 0.6], rtol=1e-12)
    # Half of a cap of sine s about the horizon: (t - s cos t) / (pi s^2), t = 45 degrees
    half = (np.pi / 4 - 0.5) / (0.5 * np.pi)
    np.testing.assert_allclose(values["sun_level"][1], half * np.array([3, 2, 1]), rtol=1e-12)


def test_discs_and_polygons_are_where_the_scene_says_at_that_moment():
    values = light_uniforms.of(lighting.at(scene_of(LIGHTS), 0.5))
    assert values["disc_place"] == [(1.0, 2.0, 3.0, 0.5)]
    np.testing.assert_allclose(values["disc_axis"], [(0, -1, 0, 1)])
    corners = np.reshape(values["polygon_corner"], (2, 4, 3))
    np.testing.assert_allclose(
        corners[0, :4], [[-1, 1, 0], [1, 1, 0], [1, 5, 0], [-1, 5, 0]], atol=1e-12
    )
    np.testing.assert_allclose(corners[1, :3], [[0, 0, 1], [1, 0, 1], [0, 1, 1]])
    np.testing.assert_allclose(corners[1, 3], corners[1, 0])


def test_no_light_is_no_uniform():
    assert light_uniforms.of(lighting.at(scene_of([]), 0.0)) == {}
