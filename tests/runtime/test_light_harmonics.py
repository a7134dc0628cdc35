"""All lights at points, together, against each by itself."""

import numpy as np

from maths import spherical_harmonics, spherical_lights, transforms
from runtime.light_harmonics import PRECISION, LightsAtPoints
from runtime.lighting import (
    DiscState,
    EnvironmentState,
    Lights,
    PolygonState,
    SphereState,
    SunState,
)

POINTS = np.array([[0.0, 0, 0], [0.4, -0.2, 1.0], [3, 2, 1]])


def test_the_sum_is_that_of_the_parts(rng: np.random.Generator) -> None:
    def light() -> np.ndarray:
        return rng.uniform(0, 3, 3)

    suns = tuple(SunState(transforms.normalise(rng.normal(size=3)), light(), r) for r in (0, 0.2))
    spheres = tuple(SphereState(rng.normal(size=3) * 3, 0.3, light()) for _ in range(3))
    discs = tuple(
        DiscState(rng.normal(size=3) * 2, np.array([0, -1.0, 0]), 0.4, light(), two)
        for two in (False, True)
    )
    corners = np.array([[2.0, 1, 0], [2, 1, 1], [2, 2, 1], [2, 2, 0]])
    polygons = (PolygonState(corners, light(), True),)
    found = LightsAtPoints({}, 3).project(Lights(suns, spheres, (), discs, polygons), POINTS)
    for point, got in zip(POINTS, found, strict=True):
        total = sum(
            spherical_lights.project_sun(s.to_light, s.irradiance, 3, angular_radius=s.radius)
            for s in suns
        )
        for s in spheres:
            total += spherical_lights.project_sphere(point, s.position, s.radius, s.radiance, 3)
        for d in discs:
            total += spherical_lights.project_disc(
                point, d.position, d.axis, d.radius, d.radiance, 3, two_sided=d.two_sided
            )
        for p in polygons:
            total += spherical_lights.project_polygon(
                point, p.corners, p.radiance, 3, two_sided=True
            )
        # Flat lights may err by PRECISION of radiance x area / distance^2, discs of .5 m2 and a
        # rectangle of 1 m2; the rest is exact
        flat = [(d.position, np.pi * d.radius**2, d.radiance) for d in discs]
        flat += [(p.corners.mean(axis=0), 1.0, p.radiance) for p in polygons]
        allowed = sum(a * e.max() / np.sum((c - point) ** 2) for c, a, e in flat) * PRECISION
        np.testing.assert_allclose(got, total, atol=1e-12 + allowed)


def test_near_lights_are_as_precise_as_far_ones(rng: np.random.Generator) -> None:
    """Lights from a tenth of their size away to a hundred times it, some of five corners."""
    n = 40
    axis = transforms.normalise(rng.normal(size=(n, 3)))
    away = POINTS[0] - axis * 10 ** rng.uniform(-1.5, 1.5, (n, 1))
    discs = tuple(DiscState(c, a, 0.3, np.ones(3), False) for c, a in zip(away, axis, strict=True))
    turn = 2 * np.pi * np.arange(5) / 5
    ring = 0.3 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    corners = [c + ring[:, [1, 2, 0]] for c in away] + [c + ring[:4] for c in away]
    polygons = tuple(PolygonState(c, np.ones(3), True) for c in corners)
    project = LightsAtPoints({}, 4).project
    for light in (*discs, *polygons):
        which = {"discs": (light,)} if isinstance(light, DiscState) else {"polygons": (light,)}
        found = project(Lights((), (), (), **which), POINTS[:1])[0]
        if isinstance(light, DiscState):
            place = POINTS[0], light.position, light.axis, light.radius, np.ones(3), 4
            truth = spherical_lights.project_disc(*place)
            middle, area = light.position, np.pi * 0.09
        else:
            truth = spherical_lights.project_polygon(
                POINTS[0], light.corners, np.ones(3), 4, two_sided=True
            )
            middle, area = light.corners.mean(axis=0), 0.3
        error = np.abs(found - truth).max()
        # Of a light beside the point distance is that of nothing: a whole sphere is the most
        assert error < PRECISION * min(area / np.sum(middle**2), 4 * np.pi) + 1e-12
        assert truth.any() == found.any()


def test_environments_turn_as_the_scene_turns_them() -> None:
    """A map whose only bright texel stands at -z, turned by a quarter about +y: it comes to -x."""
    radiance = np.zeros((16, 32, 3))
    radiance[7:9, 15:17] = 1.0
    lights = LightsAtPoints({2: radiance}, 4)
    state = EnvironmentState(2, np.array([1.0, 2, 3]), np.pi / 2)
    found = lights.project(Lights((), (), (state,)), POINTS[:1])[0]
    toward = np.array([[-1.0, 0, 0], [1, 0, 0], [0, 0, -1], [0, 0, 1]])
    values = spherical_harmonics.evaluate(toward, 4) @ found
    assert values[0, 0] > 5 * np.abs(values[1:, 0]).max()
    np.testing.assert_allclose(values[0] / values[0, 0], [1, 2, 3], rtol=1e-12)
    # A light that is no longer there shines no more
    other = EnvironmentState(5, np.ones(3), 0.0)
    assert not lights.project(Lights((), (), (other,)), POINTS).any()
