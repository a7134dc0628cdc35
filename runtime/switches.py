"""Effects as a window lists them: on, off, left out by the plan, or needed by others. No OpenGL."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from formats.meshes import EFFECTS
from runtime.edits import Edits, LightEdit

LENS = ("defocus", "depth_of_field")
LIT_BY = {effect: lighting for lighting, effect in EFFECTS.items()}


@dataclass(frozen=True)
class Switch:
    """An effect of the plan.

    called : the plan calls for it. on : it is in the picture. free : hands may switch it. why : the
    plan's reason, and bound where there is one.
    """

    name: str
    called: bool
    on: bool
    free: bool
    why: str

    @property
    def label(self) -> str:
        """Name to show."""
        return self.name.replace("_", " ")


def switches(player: Any, base: Any, edits: Edits) -> list[Switch]:
    """Return every effect of the player's plan. base : the scene as its file has it."""
    found = []
    for effect in player.plan["effects"]:
        name, called = effect["name"], effect["name"] in player.called
        on = called and is_on(base, edits, name)
        free = called and switched(player, base, edits, name, not on) is not None
        found.append(Switch(name, called, on, free, _why(effect, called)))
    return found


def is_on(base: Any, edits: Edits, name: str) -> bool:
    """Tell whether an effect that is called for is in the picture."""
    if name in LENS:
        return "lens" not in edits.off
    if name in ("billboard", "particles"):
        return any(each not in edits.hidden for each in _sets(base, name))
    if name in LIT_BY:
        return any(f"mesh/{mesh.name}" not in edits.hidden for mesh in _lit(base, name))
    if name == "occlusion":
        return any(f"shadow/{mesh.name}" not in edits.hidden for mesh in _casters(base))
    if name == "environment":
        return any(edits.lights.get(i, LightEdit()).on for i in _maps(base))
    return name not in edits.off


def switched(player: Any, base: Any, edits: Edits, name: str, on: bool) -> Edits | None:
    """Return edits with an effect on or off; None where the picture needs it."""
    if name in LENS:
        return edits.effect(("lens",), on)
    names = []
    if name in ("billboard", "particles"):
        # With their shadows
        names = _sets(base, name)
    elif name in player.optional:
        return edits.effect((name,), on)
    elif name in LIT_BY:
        names = [f"mesh/{mesh.name}" for mesh in _lit(base, name)]
    elif name == "occlusion":
        names = [f"shadow/{mesh.name}" for mesh in _casters(base)]
    elif name == "environment":
        for i in _maps(base):
            edits = edits.light(i, _lit_by(edits.lights.get(i, LightEdit()), on))
        return edits
    for each in names:
        edits = edits.show(each, on)
    return edits if names else None


def _lit_by(edit: LightEdit, on: bool) -> LightEdit:
    return LightEdit(on, edit.factor, edit.tint, edit.turn, edit.move)


def _lit(base: Any, name: str) -> list[Any]:
    return [mesh for mesh in base.meshes if mesh.lighting == LIT_BY[name]]


def _sets(base: Any, name: str) -> list[str]:
    """Particles are sets of sprites too."""
    found = [f"billboard/particles/{each.name}" for each in base.particles]
    if name == "billboard":
        found += [f"billboard/{each.name}" for each in base.billboards]
    return found


def _casters(base: Any) -> list[Any]:
    return [mesh for mesh in base.meshes if mesh.shadow is not None]


def _maps(base: Any) -> list[int]:
    return [i for i, light in enumerate(base.lights) if light.type == "environment"]


def _why(effect: dict[str, Any], called: bool) -> str:
    why = effect["reason"]
    if called and not effect["called"]:
        why += "; drawn here because the camera may go anywhere"
    if effect.get("bound") is not None and effect.get("unit"):
        why += f" (bound {effect['bound']:.3g} {effect['unit']})"
    return str(why)
