"""The scene's own lights on cubes, baked, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from bake import lightmap, voxel_faces
from bake.lightmap import Params
from bake.lightmap_lights import Lamp, sampler
from formats.errors import InputError
from formats.lightmap import Lightmap
from formats.voxels import Voxels
from maths import area_lights
from maths.disc_lights import disc_irradiance
from maths.polygon_lights import polygon_irradiance
from tests.bake.cell_worlds import of

Array = NDArray[np.float64]
FEW = Params(texels=1, rays=256, target=0)
E, UP = (3.0, 2.0, 1.0), np.array([0.0, 1.0, 0.0])
PLACE = (1.0, 2.0, -3.0)
SQUARE = ((4.0, 6.0, 3.0), (8.0, 6.0, 3.0), (8.0, 6.0, 9.0), (4.0, 6.0, 9.0))
BALL = Lamp("sphere", E, (5.0, 4.0, 6.5), 1.2)
LAMPS = {
    "sphere": (BALL, lambda at: area_lights.sphere_irradiance(at, UP, BALL.place, 1.2, E)),
    "disc": (
        Lamp("disc", E, (5.0, 4.0, 6.5), 1.5, axis=(0.0, -1.0, 0.0)),
        lambda at: disc_irradiance(at, UP, [5.0, 4.0, 6.5], -UP, 1.5, E),
    ),
    "polygon": (
        Lamp("polygon", E, axis=(0.0, -1.0, 0.0), corners=SQUARE),
        lambda at: polygon_irradiance(at, UP, np.array(SQUARE), E),
    ),
    "sun": (
        Lamp("sun", E, (0.6, 0.8, 0.0), 0.05),
        lambda at: np.broadcast_to(0.8 * np.array(E), at.shape),
    ),
}


def metres(lamp: Lamp) -> Lamp:
    """A lamp given in cells in the space of a world of cells of .5 m at PLACE."""

    def at(place: tuple[float, ...]) -> tuple[float, float, float]:
        x, y, z = (float(v) for v in 0.5 * np.array(place) + PLACE)
        return x, y, z

    if lamp.kind == "sun":
        return lamp
    return replace(
        lamp,
        place=at(lamp.place),
        radius=0.5 * lamp.radius,
        corners=tuple(map(at, lamp.corners)),
    )


def floor(*walls: tuple[slice, slice, slice]) -> Voxels:
    cells = np.zeros((12, 10, 12), np.uint16)
    cells[:, 0] = 1
    for wall in walls:
        cells[wall] = 1
    return replace(of(cells, [0.5], [0.0]), cell_size=0.5, origin=PLACE)


def lit(world: Voxels, *lamps: Lamp, params: Params = FEW) -> tuple[Lightmap, NDArray[np.bool_]]:
    """Its light, and the texels of the floor."""
    faces = voxel_faces.layout(
        world.cells, texels=params.texels, cell_size=world.cell_size, origin=world.origin
    )
    found = lightmap.gather(world, faces, params=params, lamps=tuple(map(metres, lamps)))
    height = np.nan_to_num(faces.positions()[..., 1])
    return found, (faces.normals()[..., 1] > 0) & (np.abs(height - PLACE[1] - 0.5) < 1e-3)


@pytest.mark.parametrize("kind", LAMPS)
def test_lights_overhead_are_their_closed_forms(kind: str) -> None:
    lamp, truth = LAMPS[kind]
    found, up = lit(floor(), lamp)
    at = (found.faces.positions()[up].astype(float) - PLACE) / 0.5
    light, expected = found.irradiance[up].astype(float), truth(at)
    size = np.sqrt(np.mean(expected**2))
    # 256 evenly spread rays each: measured .02 to .3 %, 1.4 % for the disc, and .16 % of its mean
    assert np.sqrt(np.mean((light - expected) ** 2)) < 0.02 * size
    assert abs(light.mean() / expected.mean() - 1) < 0.005


def test_a_wall_throws_a_sharp_shadow() -> None:
    pillar = (slice(5, 6), slice(1, 4), slice(5, 6))
    sun = Lamp("sun", E, (0.6, 0.8, 0.0))
    found, up = lit(floor(pillar), sun, params=replace(FEW, texels=4, rays=8, bounces=0))
    at = (found.faces.positions()[up].astype(float) - PLACE) / 0.5
    light = found.irradiance[up]
    # Towards -x, as long as the pillar's height times .6 / .8
    hidden = (at[:, 2] > 5) & (at[:, 2] < 6) & (at[:, 0] < 6) & (at[:, 0] > 5 - 3 * 0.75)
    assert not light[hidden].any()
    np.testing.assert_allclose(
        light[~hidden], np.tile(0.8 * np.array(E), (sum(~hidden), 1)), rtol=1e-5
    )


def test_the_shadow_of_a_ball_ends_before_it() -> None:
    """A plate under a lamp hides it; one over it does not."""
    over, under = (slice(3, 10), slice(8, 9), slice(2, 9)), (slice(3, 10), slice(2, 3), slice(2, 9))
    found, up = lit(floor(over), BALL, params=replace(FEW, bounces=0))
    at = (found.faces.positions()[up].astype(float) - PLACE) / 0.5
    np.testing.assert_allclose(found.irradiance[up], LAMPS["sphere"][1](at), rtol=0.05)
    found, up = lit(floor(under), BALL, params=replace(FEW, bounces=0))
    at = (found.faces.positions()[up].astype(float) - PLACE) / 0.5
    middle = np.hypot(at[:, 0] - 5.5, at[:, 2] - 6.5) < 2
    assert not found.irradiance[up][middle].any()


def test_no_light_leaks_into_a_closed_box() -> None:
    cells = np.ones((5, 5, 5), np.uint16)
    cells[1:-1, 1:-1, 1:-1] = 0
    world = replace(of(cells, [0.5], [0.0]), cell_size=0.5, origin=PLACE)
    faces = voxel_faces.layout(cells, texels=4, cell_size=0.5, origin=PLACE)
    bright = (1000.0, 1000.0, 1000.0)
    lamps = (Lamp("sun", bright, (0.6, 0.8, 0.0), 0.1), Lamp("sphere", bright, (2.5, 9, 2.5), 1.0))
    found = lightmap.gather(
        world, faces, params=replace(FEW, texels=4, rays=64), lamps=tuple(map(metres, lamps))
    )
    ahead = (np.nan_to_num(faces.positions()) - PLACE) / 0.5 + 0.5 * faces.normals()
    within = np.all((ahead > 1) & (ahead < 4), axis=-1) & (faces.cell() >= 0)
    assert within.sum() == 6 * 9 * 16
    assert not found.irradiance[within].any()
    assert found.irradiance.max() > 500


def test_light_of_lamps_is_handed_on() -> None:
    """Over a grey corner as bounces say, and nothing without a lamp that shines."""
    wall = (slice(0, 12), slice(1, 8), slice(0, 1))
    sun = LAMPS["sun"][0]
    none, one, two = (lit(floor(wall), sun, params=replace(FEW, bounces=n))[0] for n in (0, 1, 2))
    assert none.irradiance.sum() < one.irradiance.sum() < two.irradiance.sum()
    dark, _ = lit(floor(wall), replace(sun, strength=(0.0, 0.0, 0.0)))
    assert not dark.irradiance.any()


def test_other_kinds_are_refused() -> None:
    with pytest.raises(ValueError, match="sphere"):
        sampler(Lamp("laser", E), np.zeros(3), 1.0)


def test_numbers_that_are_none_are_refused() -> None:
    for lamp in (
        Lamp("sun", (np.nan, 1.0, 1.0)), Lamp("sphere", E, (0.0, np.inf, 0.0), 1.0),
        Lamp("disc", E, radius=-1.0), Lamp("polygon", E, corners=((np.nan, 0.0, 0.0),) * 3),
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"light .{lamp.kind}.*finite"):
            lamp.check()
