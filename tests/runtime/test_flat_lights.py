"""Sprites under discs and polygons against the ball that they look like from afar."""

import numpy as np
import pytest

from formats.billboard import Ring
from runtime import lighting

FAR = np.array([30.0, 12.0, 40.0])
TOWARDS = FAR / np.linalg.norm(FAR)
CENTRES = np.zeros((1, 3))
RADIANCE = np.array([3.0, 2.0, 1.0])


def rows(**lights):
    """Series of one sprite at the origin under the given lights alone."""
    empty = {"suns": (), "spheres": (), "environments": ()}
    made = lighting.SpriteLighting().project(
        lighting.Lights(**{**empty, **lights}),
        lighting.RingSeries(Ring()),
        0.3,
        CENTRES,
        np.zeros(1, bool),
    )
    return made[0][made[1][0]]


def square(side):
    across = np.cross([0.0, 1, 0], -TOWARDS)
    across /= np.linalg.norm(across)
    up = np.cross(-TOWARDS, across)
    return np.array(
        [FAR + side / 2 * (x * across + y * up) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    )


@pytest.mark.parametrize("two_sided", [False, True])
def test_from_afar_a_flat_light_is_a_ball_of_its_area(two_sided):
    ball = rows(spheres=(lighting.SphereState(FAR, 1.0, RADIANCE),))
    disc = rows(discs=(lighting.DiscState(FAR, -TOWARDS, 1.0, RADIANCE, two_sided),))
    side = float(np.sqrt(np.pi))
    flat = rows(polygons=(lighting.PolygonState(square(side), RADIANCE, two_sided),))
    scale = np.abs(ball).max()
    # Seen over 1 m at 51 m, solid angles and mean directions differ by some r^2 / d^2 = 4e-4
    assert np.abs(disc - ball).max() < 5e-4 * scale
    assert np.abs(flat - ball).max() < 5e-4 * scale


def test_seen_from_behind_it_is_dark():
    disc = lighting.DiscState(FAR, TOWARDS, 1.0, RADIANCE, False)
    assert np.abs(rows(discs=(disc,))).max() == 0
    back = lighting.PolygonState(square(2.0)[::-1], RADIANCE, False)
    assert np.abs(rows(polygons=(back,))).max() == 0
