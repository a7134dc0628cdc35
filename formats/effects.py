"""The table of effects, in frame order: what each needs and when a scene calls for it.

An effect that is not called for is neither baked, nor loaded, compiled, allocated or drawn.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from formats import (
    film_bounds,
    fog_bounds,
    lens_bounds,
    light_bounds,
    occlusion_bounds,
    particle_bounds,
    post,
    silhouette_bounds,
    voxel_effects,
)
from formats.errors import InputError
from formats.lens_blur import largest_texels
from formats.lens_bounds import Blur
from formats.meshes import KINDS, PlacedMesh, shown
from formats.plan import LINES, Decision, EffectPlan, LightPlan
from formats.poses import mesh_balls, poses
from formats.scene import Billboards, EnvironmentLight, Scene
from maths import optics

Reports = Mapping[str, Mapping[str, Any]]  # asset, such as billboard/oak -> its report, where baked
LEAST_BLUR = 0.5  # pixels: a smaller circle changes nothing, in no pass
LEAST_CODES = 0.5  # of 8-bit codes: less moves no pixel by more than one
CODES = "8-bit codes"
MOST_LINES = 16384  # of any picture: assets are baked once for all sizes
MOST_LIGHTS = 16  # on meshes, environments apart


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
    if not _has_lens(scene):
        return 0.0
    return float(optics.lod(largest_texels(scene, billboards, texels_per_metre), lens_scale))


@lru_cache(maxsize=2)
def _has_lens(scene: Scene) -> bool:
    """Whether the lens is called for before anything is baked, the same for all sets of a scene."""
    row = next(row for row in EFFECTS if row.name == "depth_of_field")
    return _decide(row, scene, {}, MOST_LINES).called


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
    codes = found.codes
    if codes is None:
        codes = film_bounds.MOST if found.called else 0.0
    return EffectPlan(
        row.name, called, reason, found.bound, found.unit, forced is not None, row.kinds, codes
    )


def lights(scene: Scene, reports: Reports | None = None) -> tuple[LightPlan, ...]:
    """Every light in order, kept or left out, after [force].

    Raises InputError where [force] asks to leave all of them out.
    """
    if scene.force.get("lights") is False:
        remedy = "remove this line: the plan leaves out what adds nothing; true keeps all"
        raise InputError(scene.file, "force.lights", "false", remedy)
    return light_bounds.decide(scene, reports or {})


def environment(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Light from all around, where some of it is kept."""
    found = [light for light in scene.lights if isinstance(light, EnvironmentLight)]
    if not found:
        return Decision(False, "no light is an environment")
    scale = max(float(np.max(light.scale.extremes[1])) for light in found)
    reason = f"{len(found)} environment{'s' * (len(found) > 1)} with a scale of at most {scale:g}"
    plans = [each for each in lights(scene, reports) if each.type == "environment"]
    kept = [each for each in plans if each.kept or each.reason.startswith("forced off")]
    codes = [film_bounds.MOST if each.codes is None else each.codes for each in plans]
    if not kept:
        reason += f" add at most {sum(codes):.3g} {CODES}"
    most = min(sum(codes), film_bounds.MOST)
    return Decision(bool(kept) and scale > 0.0, reason, scale, "x radiance", most)


def surface(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Opaque meshes, where any stands. InputError where more lights shine than its shader takes."""
    found = [mesh for mesh in scene.meshes if mesh.lighting == "direct"]
    if not found:
        which = " with direct lighting" if scene.meshes else ""
        return Decision(False, f"the scene has no mesh{which}", 0.0, "meshes")
    near = sum(not isinstance(light, EnvironmentLight) for light in scene.lights)
    if near > MOST_LIGHTS:
        remedy = f"meshes take at most {MOST_LIGHTS} lights besides environments; join or drop some"
        raise InputError(scene.file, "lights", near, remedy)
    return _standing(scene, reports, found, "stand")


def transfer(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Opaque meshes that shade and light themselves, where any stands."""
    found = [mesh for mesh in scene.meshes if mesh.lighting == "transfer"]
    if not found:
        return Decision(False, "no mesh has lighting = transfer", 0.0, "meshes")
    return _standing(scene, reports, found, "lit by transfer stand")


def _standing(scene: Scene, reports: Reports, found: list[PlacedMesh], do: str) -> Decision:
    """Meshes, called for where they may be seen."""
    count = len(found)
    reason = f"{count} mesh{'es' * (count > 1)} {do}{'s' * (count == 1)} in it"
    # A lens over meshes blurs what is behind them too: only without one do they leave no trace
    known = all("bounds" in reports.get(f"{KINDS[m.lighting]}/{m.name}", {}) for m in found)
    around = _mesh_balls(scene, reports, {mesh.name for mesh in found})
    if known and scene.camera.lens is None and not _seen(scene, around):
        return Decision(False, f"{reason}, out of every view", 0.0, CODES)
    return Decision(True, reason, float(count), "meshes")


def ground(scene: Scene, reports: Reports, lines: int) -> Decision:
    """A plane to stand on."""
    if scene.ground is None:
        return Decision(False, "the scene has no [ground]")
    reason = f"[ground] lies at {scene.ground.height:g} m"
    if not fog_bounds.sees_ground(scene):
        return Decision(False, f"{reason}, where the still camera never looks", 0.0, CODES)
    return Decision(True, reason)


def sky(scene: Scene, reports: Reports, lines: int) -> Decision:
    """A gradient behind everything."""
    if scene.picture.sky is None:
        return Decision(False, "the scene has no picture.sky")
    if fog_bounds.hides_sky(scene):
        return Decision(False, "the ground fills the view of the still camera", 0.0, CODES)
    return Decision(True, "picture.sky is described")


def occlusion(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Soft shadows of meshes, where light may reach something opaque past one."""
    casters = [mesh for mesh in scene.meshes if mesh.shadow is not None]
    if not casters:
        return Decision(False, "no mesh has a shadow", 0.0, CODES)
    if not voxel_effects.drawn(scene) and not any(each.kept for each in lights(scene, reports)):
        return Decision(False, "no light is kept that a mesh could hide", 0.0, CODES)
    passes = {"surface" if mesh.lighting == "direct" else mesh.lighting for mesh in casters}
    if all(scene.force.get(name) is False for name in passes):
        return Decision(False, "the meshes are forced off, and so are their shadows")
    count = len(casters)
    if voxel_effects.drawn(scene):
        return Decision(True, f"{count} mesh{'es' * (count > 1)} may shade the cubes")
    codes, share, name = occlusion_bounds.codes(scene, reports)
    reason = (
        f"{count} mesh{'es' * (count > 1)} cast{'s' * (count == 1)} a shadow, {name} of at most "
        f"{100 * share:.2g} % of the light"
    )
    return Decision(codes >= LEAST_CODES, reason, codes, CODES, codes)


def fog(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Fog, where it changes the farthest thing seen by more than half an 8-bit code."""
    described = scene.picture.fog
    if described is None:
        return Decision(False, "the scene has no picture.fog")
    if described.extinction.extremes[1] == 0.0:
        return Decision(False, "the extinction of picture.fog is 0", 0.0, "8-bit codes")
    distance, what, low = fog_bounds.reach(scene, reports)
    codes = fog_bounds.codes(scene, described, distance, low)
    where = f"{what} at {distance:,.0f} m" if np.isfinite(distance) else what
    reason = f"it changes {where} by at most {codes:.3g} {CODES}"
    return Decision(codes >= LEAST_CODES, reason, codes, CODES, codes)


def defocus(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Blur of the lens on meshes, ground and sky, where a circle of confusion reaches half a pixel.

    Without meshes the ground blurs itself as it is drawn, and nothing needs to be gathered.
    """
    if scene.camera.lens is None:
        return Decision(False, "the camera has no lens")
    if not shown(scene) and not voxel_effects.drawn(scene):
        return Decision(False, "no mesh stands in it, and the ground blurs by its own", 0.0, "px")
    blur = lens_bounds.of_opaque(scene, reports, lines)
    if blur is None:
        return Decision(False, "the camera sees nothing opaque that the lens could blur", 0.0, "px")
    return _lens(blur, lines, "; under half a pixel it gathers each pixel from itself alone")


def billboard(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Relit sprites and pictures, where any stands, and particles."""
    sprites = sum(len(billboards.instances()) for billboards in scene.billboards)
    if particle_bounds.drawn(scene, reports, lines):
        return Decision(True, "it draws the particles", float(sprites), "sprites")
    if sprites == 0:
        return Decision(False, "the scene has no sprite", 0.0, "sprites")
    sets = len(scene.billboards)
    reason = f"{sprites} sprite{'s' * (sprites > 1)} of {sets} set{'s' * (sets > 1)} stand in it"
    found = [lens_bounds.balls(billboards, reports) for billboards in scene.billboards]
    shadows = scene.ground is not None and any(each.shadow for each in scene.billboards)
    known = all(each.known for each in found) and not (shadows and fog_bounds.sees_ground(scene))
    around = [(each.middles, each.radii) for each in found if len(each.middles)]
    if known and not _seen(scene, around):
        return Decision(False, f"{reason}, out of every view", 0.0, CODES)
    return Decision(True, reason, float(sprites), "sprites")


def depth_of_field(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Blur of the lens on sprites, where a circle of confusion reaches half a pixel."""
    if scene.camera.lens is None:
        return Decision(False, "the camera has no lens")
    blurs = []
    if scene.force.get("billboard") is not False:
        blurs.append(lens_bounds.of_sprites(scene, reports, lines))
    if _blurs_ground(scene):
        blurs.append(lens_bounds.of_ground(scene, lines))
    found = [blur for blur in blurs if blur is not None]
    if not found:
        return Decision(False, "the camera sees no sprite that the lens could blur", 0.0, "px")
    blur = max(found, key=lambda blur: blur.pixels)
    scales = [r.get("layout", {}).get("lens_scale", 1.0) for r in reports.values()]
    # Sprites take lens_scale texels a texel of the circle: one texel changes nothing
    return _lens(blur, lines, "; under half a pixel every level stays", max([2.0, *scales]) / 2.0)


def film(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Exposure, tonemap and the step to 8 bits."""
    return Decision(True, "it makes the picture of radiance")


def _lens(blur: Blur, lines: int, why_not: str, factor: float = 1.0) -> Decision:
    """A lens, called for where its circle times a factor reaches half a pixel."""
    reason = (
        f"the largest circle of confusion is {blur.pixels:.3g} px of {lines} lines "
        f"({blur.name} at {blur.distance:.3g} m, {blur.t:.3g} s)"
    )
    called = blur.pixels * factor >= LEAST_BLUR
    return Decision(called, reason if called else reason + why_not, blur.pixels, "px")


def _blurs_ground(scene: Scene) -> bool:
    """Whether the ground blurs itself: with meshes or cubes the gather does."""
    drawn = scene.ground is not None and scene.force.get("ground") is not False
    return drawn and not shown(scene) and not voxel_effects.drawn(scene)


def _mesh_balls(scene: Scene, reports: Reports, names: set[str]) -> list[tuple[Any, Any]]:
    found = mesh_balls(scene, reports, lens_bounds.UNKNOWN_REACH)
    return [(middle[None], np.array([radius])) for name, middle, radius in found if name in names]


def _seen(scene: Scene, found: list[tuple[Any, Any]]) -> bool:
    """Whether the camera may ever see one of these balls."""
    half = scene.camera.sensor_height_mm / 2000.0
    return any(
        bool(pose.depths(middles, radii, half)[0].any())
        for pose in poses(scene)
        for middles, radii in found
    )


EFFECTS = (
    Row(
        "environment",
        ("environment",),
        'a light of type "environment"',
        lambda scene: any(isinstance(light, EnvironmentLight) for light in scene.lights),
        environment,
    ),
    Row("lightmap", ("lightmap",), "[voxels]", voxel_effects.drawn, voxel_effects.lightmap),
    Row("gather", ("faces",), "[voxels]", voxel_effects.drawn, voxel_effects.gather),
    Row("probe", (), "[voxels]", voxel_effects.drawn, voxel_effects.probe),
    Row("voxels", ("voxels",), "[voxels]", lambda s: s.voxels is not None, voxel_effects.voxels),
    Row(
        "surface",
        ("mesh",),
        "[[meshes]]",
        lambda scene: any(mesh.lighting == "direct" for mesh in scene.meshes),
        surface,
    ),
    Row(
        "transfer",
        ("transfer",),
        '[[meshes]] with lighting = "transfer"',
        lambda scene: any(mesh.lighting == "transfer" for mesh in scene.meshes),
        transfer,
    ),
    Row("ground", (), "[ground]", lambda scene: scene.ground is not None, ground),
    Row("sky", (), "picture.sky", lambda scene: scene.picture.sky is not None, sky),
    Row(
        "occlusion",
        ("occlusion",),
        "meshes.shadow",
        lambda scene: any(mesh.shadow is not None for mesh in scene.meshes),
        occlusion,
    ),
    Row("fog", (), "picture.fog", lambda scene: scene.picture.fog is not None, fog),
    Row(
        "silhouette",
        (),
        "meshes.silhouette_width",
        lambda s: any(mesh.silhouette_width > 0.0 for mesh in s.meshes),
        silhouette_bounds.silhouette,
    ),
    Row("defocus", (), "camera.lens", lambda scene: scene.camera.lens is not None, defocus),
    Row("particles", (), "[[particles]]", lambda s: bool(s.particles), particle_bounds.particles),
    Row(
        "billboard",
        ("billboard",),
        "[[billboards]] or [[particles]]",
        lambda scene: bool(scene.billboards or scene.particles),
        billboard,
    ),
    Row(
        "depth_of_field",
        (),
        "camera.lens",
        lambda scene: scene.camera.lens is not None,
        depth_of_field,
    ),
    Row("radial_blur", (), "picture.radial_blur", post.has_streaks, post.radial_blur),
    Row("bloom", (), "picture.bloom", lambda s: s.picture.bloom is not None, post.bloom),
    Row("film", (), "picture.film", lambda scene: True, film),
)
