"""Hard cases of lights: closed forms near, far and across the horizon, and lights that are none."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

from maths import (
    area_lights,
    circular_lights,
    disc_lights,
    hemispherical_lights,
    polygon_lights,
    spherical_lights,
)
from pipelines.hard import scenes
from pipelines.hard.cells import Family, Result, all_of, at_most, equal, refused

lights = Family("light in closed form")
DOWN = np.array([0.0, 1.0, 0.0])


def close(found: object, truth: object, bound: float, why: str = "") -> Result:
    return at_most(np.abs(np.asarray(found) / np.asarray(truth) - 1).max(), bound, why)


lights.row("L1", "a ball above, cut by and below the horizon", "pi s^2 cos, then less, then 0",
           "closed form; continuous across the horizon")  # fmt: skip


@lights.cell("L1", "maths.area_lights")
def _ball() -> Result:
    angles = np.linspace(0, np.pi, 721)
    centre = 2.0 * np.stack([np.sin(angles), np.cos(angles), 0 * angles], -1)
    E = area_lights.sphere_irradiance(np.zeros(3), DOWN, centre, 1.0, [1.0] * 3)[:, 0]
    above = angles <= np.pi / 3
    return all_of(
        close(E[above], np.pi / 4 * np.cos(angles[above]), 1e-12),
        equal(E[angles >= 2 * np.pi / 3 + 1e-9], 0.0),
        at_most(np.abs(np.diff(E)).max(), np.pi / 4 * np.pi / 720 * 1.01, "slope at most pi s^2"),
    )


lights.row("L2", "a ball that is touched, entered, far away or tiny", "finite, never above pi L",
           "pi L is the whole hemisphere")  # fmt: skip


@lights.cell("L2", "maths.area_lights")
def _near() -> Result:
    distance = np.array([1e-9, 0.5, 1.0, 1 + 1e-12, 1.05, 1e6, 1e15])
    centre = distance[:, None] * DOWN
    E = area_lights.sphere_irradiance(np.zeros(3), DOWN, centre, 1.0, [1.0] * 3)
    return all_of(equal(np.isfinite(E).all(), True), at_most(E.max(), np.pi * (1 + 1e-12)))


lights.row(
    "L3", "a disc over its axis, from touching to far", "pi R^2 / (R^2 + h^2)", "closed form"
)


@lights.cell("L3", "maths.disc_lights")
def _disc() -> Result:
    h = 10.0 ** np.arange(-6.0, 7)
    E = disc_lights.disc_irradiance(np.zeros(3), DOWN, h[:, None] * DOWN, -DOWN, 1.0, [1.0] * 3)
    return close(E[:, 0], np.pi / (1 + h**2), 1e-9, "as measured at 1e6 radii")


lights.row("L4", "a square over a corner, from touching to far", "two arc tangents a side",
           "closed form")  # fmt: skip


@lights.cell("L4", "maths.polygon_lights")
def _square() -> Result:
    h = 10.0 ** np.arange(-3.0, 4)
    E = []
    for x in h:
        centre = np.array([0.5, x, 0.5])
        corners = polygon_lights.rectangle_corners(centre, [0.5, 0, 0], [0, 0, 0.5])
        E.append(polygon_lights.polygon_irradiance(np.zeros(3), DOWN, corners, [1.0] * 3)[0])
    a = 1 / h
    root = np.sqrt(1 + a * a)
    return close(E, a / root * np.arctan(a / root), 1e-9, "rounding of areas at 1000 sides")


lights.row(
    "L5", "a flat light seen from behind or edge on", "0, or both sides where asked", "exact"
)


@lights.cell("L5", "maths.polygon_lights")
def _behind() -> Result:
    corners = polygon_lights.rectangle_corners([0, 1.0, 0], [1.0, 0, 0], [0, 0, -1.0])
    back = polygon_lights.polygon_irradiance(np.zeros(3), DOWN, corners, [1.0] * 3)
    both = polygon_lights.polygon_irradiance(np.zeros(3), DOWN, corners, [1.0] * 3, two_sided=True)
    edge = polygon_lights.polygon_irradiance([5.0, 1, 0], DOWN, corners, [1.0] * 3)
    return all_of(equal(back, 0.0), equal(edge, 0.0), equal(both > 0, True))


lights.row("L6", "a sun that sets", "cos above, a part of the disc on the horizon, 0 below",
           "monotone; half of it at 0 within the disc's own angle")  # fmt: skip


@lights.cell("L6", "maths.area_lights")
def _sunset() -> Result:
    a = np.radians(np.linspace(-3, 3, 601))
    towards = np.stack([np.cos(a), np.sin(a), 0 * a], -1)
    E = area_lights.sun_irradiance(DOWN, towards, [1.0] * 3, np.radians(0.265))[:, 0]
    high = a > np.radians(0.27)
    return all_of(
        close(E[high], np.sin(a[high]), 1e-6, "a disc of 0.27 degrees counts as its middle"),
        equal(E[a < -np.radians(0.27)], 0.0), at_most(-np.diff(E).min(), 1e-15, "monotone"),
    )  # fmt: skip


HERE, ABOVE = np.zeros(3), 2.0 * DOWN
WHITE = [1.0, 1.0, 1.0]
LINE = [[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [3.0, 1.0, 0.0]]

lights.row("L7", "lights without any size", "no light, exactly, or refused", "0")


@lights.cell("L7", "maths.area_lights")
def _no_ball() -> Result:
    ball = area_lights.sphere_irradiance
    return all_of(*(equal(ball(HERE, DOWN, c, R, WHITE), 0.0)
                    for c in (HERE, ABOVE) for R in (0.0, -1.0)))  # fmt: skip


@lights.cell("L7", "maths.disc_lights")
def _no_disc() -> Result:
    disc = disc_lights.disc_irradiance
    return all_of(*(equal(disc(HERE, DOWN, c, -DOWN, R, WHITE, two_sided=True), 0.0)
                    for c in (HERE, ABOVE) for R in (0.0, -1.0)))  # fmt: skip


@lights.cell("L7", "maths.polygon_lights")
def _no_polygon() -> Result:
    polygon = polygon_lights.polygon_irradiance
    outlines = (LINE, [ABOVE] * 3, [HERE] * 4, [HERE, ABOVE, HERE, ABOVE])
    return all_of(*(equal(polygon(HERE, DOWN, o, WHITE, two_sided=True), 0.0) for o in outlines))


@lights.cell("L7", "maths.spherical_lights")
def _no_harmonics() -> Result:
    ball, polygon = spherical_lights.project_sphere, spherical_lights.project_polygon
    return all_of(
        *(equal(ball(HERE, c, 0.0, WHITE, 4), 0.0) for c in (HERE, ABOVE)),
        equal(polygon(HERE, LINE, WHITE, 4), 0.0),
    )


def _all(found: Sequence[Result]) -> Result:
    """Refusals of one cell: the first that is none, or how many there are."""
    bad = next((result for result in found if result.verdict != "refused"), None)
    return bad or Result("refused", said=f"{len(found)} of {len(found)}, such as {found[0].said}")


def _lit(kind: str, **items: str) -> Callable[[], object]:
    """Load a scene with one light of a kind, of which some items are broken."""
    table = {"type": f'"{kind}"'} | SOUND[kind] | items
    text = "\n".join(f"{key} = {value}" for key, value in table.items())
    return lambda: scenes.loaded(f"{scenes.BASE}[[lights]]\n{text}\n")


FLAT = {"position": "[0, 3, 0]", "facing": "[0, -1, 0]", "radiance": "[5, 5, 5]"}
SOUND: dict[str, dict[str, str]] = {
    "sun": {"to_light": "[1, 1, 0]", "irradiance": "[3, 3, 3]"},
    "sphere": {"position": "[0, 3, 0]", "radius": "0.5", "radiance": "[5, 5, 5]"},
    "disc": FLAT | {"radius": "0.5"},
    "rectangle": FLAT | {"size": "[1, 2]"},
    "polygon": {"outline": "[[0, 3, 0], [1, 3, 0], [1, 3, 1]]", "radiance": "[5, 5, 5]"},
}


@lights.cell("L7", "formats.scene")
def _scenes_without_size() -> Result:
    return _all([
        *(refused(_lit(kind, radius=R), "radius") for kind in ("sphere", "disc")
          for R in ("0", "-1", "1e-9")),
        *(refused(_lit("rectangle", size=size), "size") for size in ("[0, 1]", "[1, 0]")),
        refused(_lit("polygon", outline="[[0, 3, 0], [1, 3, 0], [3, 3, 0]]"), "outline"),
        *(refused(_lit("polygon", outline=f"[{', '.join(['[1, 3, 0]'] * n)}]"), "outline")
          for n in (1, 2, 3)),
    ])  # fmt: skip


lights.row("L8", "lights whose numbers are NaN or infinite", "refused", "checked before any work")
NONE = (np.nan, np.inf, -np.inf)


def _each(*calls: Callable[[float], object]) -> Result:
    """Every call refuses every number that is none."""
    return _all([refused(lambda c=call, x=x: c(x)) for call in calls for x in NONE])


@lights.cell("L8", "maths.area_lights")
def _odd_balls() -> Result:
    ball, sun = area_lights.sphere_irradiance, area_lights.sun_irradiance
    return _each(
        lambda x: ball(HERE, DOWN, [0.0, x, 0.0], 1.0, WHITE),
        lambda x: ball(HERE, DOWN, ABOVE, abs(x), WHITE),
        lambda x: sun(DOWN, [x, 0.0, 0.0], WHITE),
        lambda x: sun(DOWN, DOWN, WHITE, x),
    )


@lights.cell("L8", "maths.disc_lights, maths.polygon_lights")
def _odd_plates() -> Result:
    disc, polygon = disc_lights.disc_irradiance, polygon_lights.polygon_irradiance
    return _each(
        lambda x: disc(HERE, DOWN, [0.0, x, 0.0], -DOWN, 1.0, WHITE),
        lambda x: disc(HERE, DOWN, ABOVE, [x, 0.0, 0.0], 1.0, WHITE),
        lambda x: disc(HERE, DOWN, ABOVE, -DOWN, abs(x), WHITE),
        lambda x: polygon(HERE, DOWN, [[0.0, 1.0, 0.0], [1.0, x, 0.0], [2.0, 1.0, 1.0]], WHITE),
    )


@lights.cell("L8", "maths.spherical_lights")
def _odd_harmonics() -> Result:
    odd = spherical_lights
    return _each(
        lambda x: odd.project_sphere(HERE, [0.0, x, 0.0], 1.0, WHITE, 2),
        lambda x: odd.project_sphere(HERE, ABOVE, x, WHITE, 2),
        lambda x: odd.project_disc(HERE, [0.0, x, 0.0], -DOWN, 1.0, WHITE, 2),
        lambda x: odd.project_disc(HERE, ABOVE, [0.0, x, 0.0], 1.0, WHITE, 2),
        lambda x: odd.project_disc(HERE, ABOVE, -DOWN, x, WHITE, 2),
        lambda x: odd.project_polygon(
            HERE, [[0.0, 1.0, 0.0], [1.0, x, 0.0], [0.0, 2.0, 1.0]], WHITE, 2
        ),
        lambda x: odd.project_sun([x, 0.0, 0.0], WHITE, 2),
        lambda x: odd.project_sun(DOWN, WHITE, 2, angular_radius=x),
    )


@lights.cell("L8", "maths.hemispherical_lights, maths.circular_lights")
def _odd_series() -> Result:
    dome, ring = hemispherical_lights, circular_lights
    return _each(
        lambda x: dome.project_sphere([0.0, 0.0, x], 1.0, WHITE, 3),
        lambda x: dome.project_sphere(ABOVE, x, WHITE, 3),
        lambda x: dome.project_sun([x, 0.0, 0.0], WHITE, 3),
        lambda x: ring.project_sphere([0.0, 0.0, x], 1.0, WHITE, 5),
        lambda x: ring.project_sphere(ABOVE, x, WHITE, 5),
        lambda x: ring.project_sun([x, 0.0, 0.0], WHITE, 5),
    )


@lights.cell("L8", "bake.lightmap")
def _odd_lamps() -> Result:
    from bake.lightmap_lights import Lamp

    E = (1.0, 1.0, 1.0)
    return _each(
        lambda x: Lamp("sun", (x, 1.0, 1.0), (0.0, 1.0, 0.0)).check(),
        lambda x: Lamp("sphere", E, (x, 1.0, 0.0), 1.0).check(),
        lambda x: Lamp("disc", E, (0.0, 1.0, 0.0), x).check(),
        lambda x: Lamp("disc", E, (0.0, 1.0, 0.0), 1.0, (0.0, x, 0.0)).check(),
        lambda x: Lamp("polygon", E, corners=((0, 1, 0), (1, 1, x), (1, 1, 0))).check(),
    )


@lights.cell("L8", "formats.scene")
def _odd_scenes() -> Result:
    found = []
    for kind, items in SOUND.items():
        for key, value in items.items():
            for none in ("nan", "inf", "-inf"):
                broken = re.sub(r"[\d.]+(?=\]*$)", none, value)
                found.append(refused(_lit(kind, **{key: broken}), key))
    return _all(found)


lights.row("L9", "lights of other shapes: outlines folded, bent or turned inwards, no direction",
           "refused, by table and key", "checked before any work")  # fmt: skip


@lights.cell("L9", "formats.scene")
def _bent() -> Result:
    outlines = {
        "bent": "[[0, 3, 0], [1, 3, 0], [1, 3, 1], [0, 4, 1]]",
        "folded": "[[0, 3, 0], [1, 3, 1], [1, 3, 0], [0, 3, 1]]",
        "inwards": "[[0, 3, 0], [2, 3, 0], [0.4, 3, 0.4], [0, 3, 2]]",
        "turned twice": "[[0, 3, 0], [1, 3, 0], [0.5, 3, 1], [0, 3, 0], [1, 3, 0], [0.5, 3, 1]]",
        "a star": "[[10, 3, 0], [-8, 3, 6], [3, 3, -10], [3, 3, 10], [-8, 3, -6]]",
        "of two numbers": "[[0, 3], [1, 3], [1, 4]]",
    }
    return _all([
        *(refused(_lit("polygon", outline=each), "outline") for each in outlines.values()),
        refused(_lit("sun", to_light="[0, 0, 0]"), "to_light"),
        refused(_lit("disc", facing="[0, 0, 0]"), "facing"),
        refused(_lit("rectangle", facing="[0, 0, 0]"), "facing"),
        refused(_lit("rectangle", size="1"), "size"),
        refused(_lit("sun", angular_diameter="200"), "angular_diameter"),
    ])  # fmt: skip


@lights.cell("L9", "the same, sound")
def _sound() -> Result:
    """What is refused above is what is wrong, not the rest of the table."""
    return all_of(*(equal(len(_lit(kind)().lights), 2) for kind in SOUND))  # type: ignore[attr-defined]
