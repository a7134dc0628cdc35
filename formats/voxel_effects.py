"""When a scene calls for the passes of a world of cubes."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from formats.errors import InputError
from formats.keyed import Keyed
from formats.meshes import shown
from formats.plan import Decision
from formats.scene import EnvironmentLight, Scene

MOST_LIGHTS = 16
"""On cubes, environments apart."""
Reports = Mapping[str, Mapping[str, Any]]


def voxels(scene: Scene, reports: Reports, lines: int) -> Decision:
    """A world of cubes."""
    if scene.voxels is None:
        return Decision(False, "the scene has no [voxels]")
    reason = f"[voxels] has cells of {scene.voxels.cell_size:g} m"
    others = sum(not isinstance(light, EnvironmentLight) for light in scene.lights)
    if others > MOST_LIGHTS:
        remedy = f"cubes take at most {MOST_LIGHTS} besides environments; join or drop some"
        raise InputError(scene.file, "lights", others, remedy)
    if others and scene.voxels.mode == "talk" and _moving_cubes(scene):
        reason += f'; mode "talk" takes nothing of {others} of [[lights]]'
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
    """Light of a world of cubes on sprites and meshes that stand in it."""
    if not drawn(scene):
        return Decision(False, "no world of cubes is drawn")
    meshes, sprites = len(shown(scene)), _lit_sprites(scene)
    if not meshes and not sprites:
        return Decision(False, "no mesh and no lit sprite stands among the cubes")
    found = [
        f"{count} {name}{ending * (count > 1)}"
        for count, name, ending in ((meshes, "mesh", "es"), (sprites, "sprite", "s"))
        if count
    ]
    takes = "take" if meshes + sprites > 1 else "takes"
    return Decision(True, f"{' and '.join(found)} {takes} light of the cubes")


def _lit_sprites(scene: Scene) -> int:
    """How many sprites may stand in a scene that take light, those of particles included."""
    if scene.force.get("billboard") is False:
        return 0
    lit = {each.name: len(each.instances()) for each in scene.billboards if not each.pictured}
    particles = scene.particles if scene.force.get("particles") is not False else ()
    return sum(lit.values()) + sum(each.most for each in particles if each.look.billboard in lit)


def drawn(scene: Scene) -> bool:
    """Whether a world of cubes is described and not forced off."""
    return scene.voxels is not None and scene.force.get("voxels") is not False


def _moving_cubes(scene: Scene) -> str:
    """What changes the light of a world of cubes, "" where nothing does."""
    if scene.voxels is not None and scene.voxels.moving:
        return "lamps or parts move"
    for light in scene.lights:
        keyed = (getattr(light, field.name) for field in dataclasses.fields(light))
        if not all(value.constant for value in keyed if isinstance(value, Keyed)):
            return f"a light of type {light.type} changes"
    return ""
