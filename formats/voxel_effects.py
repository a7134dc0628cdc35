"""When a scene calls for the passes of a world of cubes."""

from collections.abc import Mapping
from typing import Any

from formats.errors import InputError
from formats.meshes import shown
from formats.plan import Decision
from formats.scene import EnvironmentLight, Scene

Reports = Mapping[str, Mapping[str, Any]]


def voxels(scene: Scene, reports: Reports, lines: int) -> Decision:
    """A world of cubes."""
    if scene.voxels is None:
        return Decision(False, "the scene has no [voxels]")
    reason = f"[voxels] has cells of {scene.voxels.cell_size:g} m"
    others = sum(not isinstance(light, EnvironmentLight) for light in scene.lights)
    if others:
        reason += (
            f"; {others} of [[lights]] do not light it: cubes take environments and what glows"
        )
    return Decision(True, reason)


def lightmap(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Light of a world of cubes in which nothing ever changes: baked once."""
    if not drawn(scene):
        return Decision(False, "no world of cubes is drawn")
    if scene.force.get("gather") is False:
        if scene.force.get("lightmap") is False:
            remedy = "remove this line or that of gather: cubes take their light from either"
            raise InputError(scene.file, "force.lightmap", "false", remedy)
        return Decision(True, "gather is forced off: light is that of the first moment")
    if moving := _moving_cubes(scene):
        return Decision(False, f"{moving}: light is gathered as it plays")
    return Decision(True, "nothing in the world of cubes ever changes: its light is baked")


def gather(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Light of a world of cubes in which something changes: rays while it plays."""
    if not drawn(scene):
        return Decision(False, "no world of cubes is drawn")
    if scene.force.get("lightmap") is False:
        return Decision(True, "lightmap is forced off: light is gathered as it plays")
    if not (moving := _moving_cubes(scene)):
        return Decision(False, "nothing in the world of cubes ever changes: its light is baked")
    return Decision(True, f"{moving} in the world of cubes")


def probe(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Light of a world of cubes on meshes that take it as harmonics."""
    if not drawn(scene):
        return Decision(False, "no world of cubes is drawn")
    taking = [m for m in shown(scene) if m.shadow is not None or m.lighting == "transfer"]
    if not taking:
        return Decision(False, "no mesh casts a shadow or is lit by transfer")
    count = len(taking)
    reason = f"{count} mesh{'es' * (count > 1)} take{'s' * (count == 1)} light of the cubes"
    return Decision(True, reason)


def drawn(scene: Scene) -> bool:
    """Whether a world of cubes is described and not forced off."""
    return scene.voxels is not None and scene.force.get("voxels") is not False


def _moving_cubes(scene: Scene) -> str:
    """What changes the light of a world of cubes, "" where nothing does."""
    if scene.voxels is not None and scene.voxels.moving:
        return "lamps or parts move"
    lights = [light for light in scene.lights if isinstance(light, EnvironmentLight)]
    if not all(light.scale.constant for light in lights):
        return "the environment changes"
    return ""
