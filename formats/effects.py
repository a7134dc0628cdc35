"""The table of effects, in frame order: what each needs and when a scene calls for it.

An effect that is not called for is neither baked, nor loaded, compiled, allocated or drawn.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from formats.errors import InputError
from formats.lens_blur import largest_blur, largest_texels
from formats.plan import LINES, Decision, EffectPlan
from formats.scene import Billboards, EnvironmentLight, Fog, Scene
from maths import colour, optics

Reports = Mapping[str, Mapping[str, Any]]  # asset, such as billboard/oak -> its report, where baked
LEAST_BLUR = 0.5  # pixels: a smaller circle stays within the filter of a pixel
LEAST_CODES = 0.5  # of 8-bit codes: less rounds away
EARTH_RADIUS = 6.371e6  # metres


@dataclass(frozen=True)
class Row:
    """An effect.

    kinds : of baked assets that it needs. table : where the scene asks for it, "" for nowhere.
    has_table : whether the scene does. called_for : (scene, reports, lines) -> Decision, pure.
    """

    name: str
    kinds: tuple[str, ...]
    table: str
    has_table: Callable[[Scene], bool]
    called_for: Callable[[Scene, Reports, int], Decision]


def decide(
    scene: Scene, reports: Reports | None = None, lines: int = LINES
) -> tuple[EffectPlan, ...]:
    """Every effect in frame order, after [force], for pictures `lines` pixels high.

    Raises InputError where [force] asks for what the scene does not describe.
    """
    return tuple(_decide(row, scene, reports or {}, lines) for row in EFFECTS)


def largest_lod(
    scene: Scene, billboards: Billboards, texels_per_metre: float, lens_scale: float = 1.0
) -> float:
    """The coarsest mip level that the lens asks of a set over the animation, >= 0.

    texels_per_metre : of the object at its own height. lens_scale : c of log2(c * circle of
    confusion in texels). 0 when the lens is not called for.
    """
    row = next(row for row in EFFECTS if row.name == "depth_of_field")
    if not _decide(row, scene, {}, LINES).called:
        return 0.0
    return float(optics.lod(largest_texels(scene, billboards, texels_per_metre), lens_scale))


def _decide(row: Row, scene: Scene, reports: Reports, lines: int) -> EffectPlan:
    found = row.called_for(scene, reports, lines)
    forced = scene.force.get(row.name)
    called, reason = found.called, found.reason
    if forced is not None:
        field = f"force.{row.name}"
        if forced and not row.has_table(scene):
            raise InputError(scene.file, field, "true", f"add {row.table}, or remove this line")
        if row.name == "film" and not forced:
            remedy = "remove this line: film is what makes a picture of radiance"
            raise InputError(scene.file, field, "false", remedy)
        agreed = "as" if forced == called else "although"
        called, reason = forced, f"forced {'on' if forced else 'off'}, {agreed} {reason}"
    unit = found.unit
    return EffectPlan(row.name, called, reason, found.bound, unit, forced is not None, row.kinds)


def environment(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Light from all around, where it is brighter than 0 at some time."""
    lights = [light for light in scene.lights if isinstance(light, EnvironmentLight)]
    if not lights:
        return Decision(False, "no light is an environment")
    scale = max(float(np.max(light.scale.extremes[1])) for light in lights)
    reason = f"{len(lights)} environment{'s' * (len(lights) > 1)} with a scale of at most {scale:g}"
    return Decision(scale > 0.0, reason, scale, "x radiance")


def ground(scene: Scene, reports: Reports, lines: int) -> Decision:
    """A plane to stand on."""
    if scene.ground is None:
        return Decision(False, "the scene has no [ground]")
    return Decision(True, f"[ground] lies at {scene.ground.height:g} m")


def sky(scene: Scene, reports: Reports, lines: int) -> Decision:
    """A gradient behind everything."""
    if scene.picture.sky is None:
        return Decision(False, "the scene has no picture.sky")
    return Decision(True, "picture.sky is described")


def fog(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Fog, where it changes the farthest thing seen by more than half an 8-bit code."""
    described = scene.picture.fog
    if described is None:
        return Decision(False, "the scene has no picture.fog")
    if described.extinction.extremes[1] == 0.0:
        return Decision(False, "the extinction of picture.fog is 0", 0.0, "8-bit codes")
    distance, what = _farthest(scene)
    if distance == 0.0:
        return Decision(False, "the scene shows nothing that fog could veil", 0.0, "8-bit codes")
    codes = _veil(scene, described, distance)
    reason = f"it changes {what} at {distance:,.0f} m by at most {codes:.3g} 8-bit codes"
    return Decision(codes > LEAST_CODES, reason, codes, "8-bit codes")


def billboard(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Relit sprites, where any stands."""
    sprites = sum(len(billboards.instances()) for billboards in scene.billboards)
    if sprites == 0:
        return Decision(False, "the scene has no sprite", 0.0, "sprites")
    sets = len(scene.billboards)
    reason = f"{sprites} sprite{'s' * (sprites > 1)} of {sets} set{'s' * (sets > 1)} stand in it"
    return Decision(True, reason, float(sprites), "sprites")


def depth_of_field(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Blur of the lens on sprites, where a circle of confusion reaches half a pixel."""
    if scene.camera.lens is None:
        return Decision(False, "the camera has no lens")
    if scene.force.get("billboard") is False:
        return Decision(False, "sprites are forced off, and the lens blurs only sprites", 0.0, "px")
    blur = largest_blur(scene, lines)
    if blur is None:
        return Decision(False, "the camera sees no sprite that the lens could blur", 0.0, "px")
    reason = (
        f"the largest circle of confusion is {blur.pixels:.3g} px of {lines} lines "
        f"({blur.name} at {blur.distance:.3g} m, {blur.t:.3g} s)"
    )
    return Decision(blur.pixels >= LEAST_BLUR, reason, blur.pixels, "px")


def film(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Exposure, tonemap and the step to 8 bits."""
    return Decision(True, "it makes the picture of radiance")


def _farthest(scene: Scene) -> tuple[float, str]:
    """Distance of what is seen farthest away, metres, and its name."""
    camera = scene.camera.position.values
    distance, what = 0.0, "nothing"
    for billboards in scene.billboards:
        positions = billboards.instances().positions
        if len(positions):
            # No point of a keyed way is outside the box of its keys
            box = np.stack([camera.min(axis=0), camera.max(axis=0)])
            reach = np.maximum(np.abs(positions - box[0]), np.abs(positions - box[1]))
            far = float(np.linalg.norm(reach, axis=-1).max())
            if far > distance:
                distance, what = far, f"a sprite of {billboards.name}"
    if scene.ground or scene.picture.sky:
        level = scene.ground.height if scene.ground else 0.0
        above = max(1.0, float(camera[:, 1].max()) - level)
        horizon = float(np.sqrt(2.0 * EARTH_RADIUS * above))
        if horizon > distance:
            distance, what = horizon, "the horizon"
    return distance, what


def _veil(scene: Scene, described: Fog, distance: float) -> float:
    """The most that fog over a distance changes a grey of any brightness, in 8-bit codes."""
    low = float(scene.camera.position.values[:, 1].min())
    feet = [b.instances().positions[:, 1] for b in scene.billboards]
    low = min([low, *(float(y.min()) for y in feet if y.size)])
    # The density where it is highest, all along the way
    thickest = np.exp(np.clip(-described.falloff * low, -80.0, 80.0))
    depth = min(80.0, float(described.extinction.extremes[1] * thickest * distance))
    passing = np.exp(-depth)
    tonemap = colour.TONEMAPS[scene.picture.film.tonemap]
    behind = np.concatenate([[0.0], np.geomspace(1e-5, 1e3, 400)])[:, None] * np.ones(3)
    largest = 0.0
    for exposure in scene.picture.film.exposure.extremes:
        for radiance in described.radiance.extremes:
            veiled = passing * behind + (1.0 - passing) * radiance
            codes = [
                255.0 * colour.srgb_encode(tonemap(2.0**exposure * image))
                for image in (behind, veiled)
            ]
            largest = max(largest, float(np.abs(codes[1] - codes[0]).max()))
    return largest


EFFECTS = (
    Row(
        "environment",
        ("environment",),
        'a light of type "environment"',
        lambda scene: any(isinstance(light, EnvironmentLight) for light in scene.lights),
        environment,
    ),
    Row("ground", (), "[ground]", lambda scene: scene.ground is not None, ground),
    Row("sky", (), "picture.sky", lambda scene: scene.picture.sky is not None, sky),
    Row("fog", (), "picture.fog", lambda scene: scene.picture.fog is not None, fog),
    Row(
        "billboard",
        ("billboard",),
        "[[billboards]]",
        lambda scene: bool(scene.billboards),
        billboard,
    ),
    Row(
        "depth_of_field",
        (),
        "camera.lens",
        lambda scene: scene.camera.lens is not None,
        depth_of_field,
    ),
    Row("film", (), "picture.film", lambda scene: True, film),
)
