"""Which lights a picture would miss: a bound on what each adds to any pixel at any time.

A light's irradiance anywhere is at most that of a point of its brightness at the nearest of the
places where it may be, towards the nearest of those that it may light; both are boxes of keys. A
matt surface returns albedo / pi of it. A sprite returns the sum over its terms of coefficient times
projection, at most `scale |B_k|` each, and as many sprites as there are may lie over one pixel.
What is not known before it is baked keeps its lights.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import film_bounds
from formats.lens_bounds import UNKNOWN_REACH, Reports
from formats.meshes import PlacedMesh, shown
from formats.plan import LightPlan
from formats.poses import mesh_balls
from formats.scene import (
    Billboards,
    Disc,
    EnvironmentLight,
    Light,
    Polygon,
    Rectangle,
    Scene,
    Sphere,
    Sun,
)

Array = NDArray[np.float64]
LEAST = 0.5  # codes: a light of more is kept
BUDGET = 1.0  # codes of all that are left out together
SHADOWING = 3  # suns that throw shadows on the ground: those before a fourth cannot go
HARMONICS = 1.0625  # most that nine harmonics make of a light from one direction: (1 + 2 + 5/4) / 4
ROUNDING = 1.02  # of signed codes, -128 / 127, and of the quadrature of a cap
DIMMEST = 0.0722  # a luma term takes a colour that luminance counts at least by this


def decide(scene: Scene, reports: Reports) -> tuple[LightPlan, ...]:
    """Every light of the scene in order: kept or left out, and the most codes that it makes."""
    bounds = [_codes(scene, reports, light) for light in scene.lights]
    suns = [i for i, light in enumerate(scene.lights) if isinstance(light, Sun)]
    for i in suns if len(suns) > 1 else []:
        # Without the brightest, shadows of the next ones are drawn that were too faint beside it
        bounds[i] = None if bounds[i] is None else 2.0 * bounds[i]  # type: ignore[operator]
    kept = {i for i, bound in enumerate(bounds) if bound is None or bound >= LEAST}
    used = 0.0
    for i in sorted(set(range(len(bounds))) - kept, key=lambda i: (bounds[i], i)):
        used += bounds[i] or 0.0
        if used >= BUDGET or _needed(scene, i, suns):
            kept.add(i)
            used -= bounds[i] or 0.0
    return tuple(
        _plan(scene, i, light, bounds[i], i in kept, suns) for i, light in enumerate(scene.lights)
    )


def _needed(scene: Scene, i: int, suns: list[int]) -> str:
    """Why a light stays whatever it adds, "" where nothing needs it."""
    sky = scene.picture.sky
    if sky is not None and sky.glow is not None and suns[:1] == [i]:
        return "the sky glows around it"
    if len(suns) > SHADOWING and i in suns[:SHADOWING]:
        return f"without it the shadows of sun {suns[SHADOWING]} would be drawn"
    return ""


def _plan(
    scene: Scene, i: int, light: Light, bound: float | None, kept: bool, suns: list[int]
) -> LightPlan:
    most = "what it lights is not measured before it is baked"
    if bound is not None:
        bound = min(bound, film_bounds.MOST)
        most = f"it adds at most {bound:.3g} 8-bit codes anywhere"
    if kept and bound is not None and bound < LEAST:
        most += f", but {_needed(scene, i, suns) or 'others left out have used the one code up'}"
    environment = isinstance(light, EnvironmentLight)
    forced = scene.force.get("lights"), scene.force.get("environment") if environment else None
    if forced[1] is False:
        kept, most = False, f"forced off with the environment; {most}"
    elif True in forced:
        kept, most = True, f"forced on, {'as' if kept else 'although'} {most}"
    return LightPlan(i, light.type, kept, most, bound)


def _codes(scene: Scene, reports: Reports, light: Light) -> float | None:
    shines = {Sun: "irradiance", EnvironmentLight: "scale"}.get(type(light), "radiance")
    if not np.max(getattr(light, shines).extremes[1]) > 0.0:
        return 0.0
    radiance = most_radiance(scene, reports, light)
    if radiance is None:
        return None
    return film_bounds.added(scene.picture.film, radiance, scene.picture.bloom)


def most_radiance(scene: Scene, reports: Reports, light: Light) -> float | None:
    """The most that a light adds to any pixel, W/(m2 sr); None where that is not known."""
    if scene.voxels is not None and scene.force.get("voxels") is not False:
        # What light becomes from cell to cell is not bounded here
        return None
    opaque, sprites = 0.0, 0.0
    if scene.ground is not None and scene.force.get("ground") is not False:
        low, high = np.full(3, -np.inf), np.full(3, np.inf)
        low[1] = high[1] = scene.ground.height
        irradiance = _irradiance(reports, scene, light, low, high, 0.0, flat=True)
        if irradiance is None:
            return None
        opaque = irradiance * max(*scene.ground.albedo, *scene.ground.accent) / np.pi
    drawn = {mesh.name: mesh for mesh in shown(scene)}
    for name, middle, radius in mesh_balls(scene, reports, UNKNOWN_REACH):
        if name not in drawn:
            continue
        flat = drawn[name].lighting == "direct"
        irradiance = _irradiance(reports, scene, light, middle, middle, radius, flat=flat)
        if irradiance is None:
            return None
        gain = 1.0 if flat else _gain(drawn[name])
        opaque = max(opaque, gain * irradiance / np.pi)
    if scene.force.get("billboard") is not False:
        for billboards in scene.billboards:
            instances = billboards.instances()
            if billboards.pictured or not len(instances):
                continue
            response = _response(billboards, reports)
            up = np.array([0.0, 0.5, 0.0]) * (billboards.height * instances.scale)[:, None]
            middles = instances.positions + up
            irradiance = _irradiance(
                reports, scene, light, middles.min(axis=0), middles.max(axis=0), 0.0, flat=False
            )
            if response is None or irradiance is None:
                return None
            sprites += len(instances) * float(instances.tint.max()) * response * irradiance
        for found in scene.particles:
            lit = next((b for b in scene.billboards if b.name == found.look.billboard), None)
            if lit is None or lit.pictured or scene.force.get("particles") is False:
                continue
            low, high = found.box()
            response = _response(lit, reports)
            irradiance = _irradiance(reports, scene, light, low, high, 0.0, flat=False)
            if response is None or irradiance is None:
                return None
            sprites += found.most * (1.0 + 0.5 * found.look.tint) * response * irradiance
    return opaque + sprites


def _gain(mesh: PlacedMesh) -> float:
    """The most that transfer makes of light from all directions together.

    By Cauchy and Schwarz at most |T| |L|: a light of one direction has |L| = sqrt(K / 4 pi), the
    clamped cosine |T| = sqrt(2 pi / 3), and each bounce adds no more than that.
    """
    harmonics = (mesh.transfer.l_max + 1) ** 2
    return float((1 + mesh.transfer.bounces) * np.sqrt(harmonics / 6.0) * ROUNDING)


def _irradiance(
    reports: Reports,
    scene: Scene,
    light: Light,
    low: Array,
    high: Array,
    radius: float,
    *,
    flat: bool,
) -> float | None:
    """The most irradiance of a light on what lies within `radius` of a box, any channel, W/m2.

    flat : on a surface; otherwise from all directions together, as sprites count it.
    """
    if isinstance(light, Sun):
        return float(np.max(light.irradiance.extremes[1]))
    if isinstance(light, EnvironmentLight):
        factor = np.broadcast_to(np.asarray(light.scale.extremes[1]), (3,))
        index = next(i for i, other in enumerate(scene.lights) if other is light)
        report: Mapping[str, Any] = reports.get(f"environment/{index}", {})
        if "mean_radiance" not in report:
            return None
        power = 4.0 * np.pi * float((np.asarray(report["mean_radiance"]) * factor).max())
        return power * (HARMONICS if flat else ROUNDING)
    radiance = float(np.max(light.radiance.extremes[1]))
    near, far, size = _place(light)
    gap = np.maximum(np.maximum(near - high, low - far), 0.0)
    distance = max(float(np.linalg.norm(gap)) - radius, 0.0)
    sine2 = 1.0 if distance <= size else (size / distance) ** 2
    if flat:
        return radiance * np.pi * sine2
    # 1 - cos without cancellation; all around where the sprite may be inside
    height = 2.0 if distance <= size else sine2 / (1.0 + np.sqrt(1.0 - sine2))
    return radiance * 2.0 * np.pi * height * ROUNDING


def _place(light: Sphere | Disc | Rectangle | Polygon) -> tuple[Array, Array, float]:
    """Box of the keys of a light's middle, and the radius of a ball about it that holds it."""
    if isinstance(light, Polygon):
        middle = light.outline.mean(axis=0)
        size = float(np.linalg.norm(light.outline - middle, axis=1).max())
        return middle + light.offset.extremes[0], middle + light.offset.extremes[1], size
    size = 0.5 * float(np.hypot(*light.size)) if isinstance(light, Rectangle) else light.radius
    return np.asarray(light.position.extremes[0]), np.asarray(light.position.extremes[1]), size


def _response(billboards: Billboards, reports: Reports) -> float | None:
    """The most radiance that a set's texels return for a unit of light; None if not baked."""
    report = reports.get(f"billboard/{billboards.name}", {})
    if report.get("kind") != "billboard":
        return None
    layout = report["layout"]
    scales = np.abs(np.asarray(layout["scales"], np.float64))
    full = layout["packing"] == "full" or layout["ring"]["terms"] < 5
    basis = 1.0 / np.sqrt(np.pi)
    sizes = list(_terms(scales, full=full, talk=layout.get("unpack") == "talk"))
    return float(ROUNDING * basis * (sizes[0] / np.sqrt(2.0) + sum(sizes[1:])))


def _terms(scales: Array, *, full: bool, talk: bool) -> Iterator[float]:
    """The most that each term's coefficient is in any channel."""
    if full:
        yield from scales[:, :3].max(axis=1).tolist()
        return
    yield from scales[:3, :3].max(axis=1).tolist()
    lumas = np.concatenate([scales[1:3, 3], scales[3:].ravel()])
    yield from (lumas if talk else lumas / DIMMEST).tolist()
