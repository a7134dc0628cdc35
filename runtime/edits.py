"""What hands change of a scene while it is shown: light, picture, what is seen. No OpenGL.

A scene stays as its file has it; `Edits.of` gives the changed one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.keyed import Keyed
from formats.schema import Spec, specs
from runtime.lighting import turned

Array = NDArray[np.float64]
EMITTED = {"sun": "irradiance", "environment": "scale"}
"""Field of what a light sends out, by type; `radiance` of all others."""
PLACES = {"polygon": "offset"}
"""Field of where a light is, by type; `position` of all others."""


@dataclass(frozen=True)
class LightEdit:
    """What changes of one light.

    factor, tint : on what it sends out. turn : (azimuth, elevation) radians of a sun, the first of
    an environment. move : (x, y, z) metres.
    """

    on: bool = True
    factor: float = 1.0
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    turn: tuple[float, float] = (0.0, 0.0)
    move: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def of(self, light: Any) -> Any:
        """Return the light, or lamp, as it is changed."""
        if self == LightEdit():
            return light
        kind = getattr(light, "type", "lamp")
        emitted = EMITTED.get(kind, "radiance")
        found: dict[str, Any] = {emitted: self._emitted(getattr(light, emitted))}
        if kind == "sun" and any(self.turn):
            values = np.stack([turned(_unit(v), *self.turn) for v in light.to_light.values])
            found["to_light"] = replace(light.to_light, values=values)
        if kind == "environment":
            degrees = light.rotate + np.degrees(self.turn[0])
            found["rotate"] = float((degrees + 180.0) % 360.0 - 180.0)
        place = PLACES.get(kind, "position")
        if any(self.move) and hasattr(light, place):
            keyed = getattr(light, place)
            found[place] = replace(keyed, values=keyed.values + np.asarray(self.move))
        return replace(light, **found)

    def _emitted(self, keyed: Keyed) -> Keyed:
        factor = np.asarray(self.tint) * self.factor * self.on
        values = keyed.values if keyed.values.ndim == 2 else keyed.values[:, None]
        return replace(keyed, values=values * factor)


@dataclass(frozen=True)
class Edits:
    """All that hands changed.

    lights : number among the player's lights -> its edit. lamps : number among the lamps of the
    world of cubes -> its edit. values : TABLE.FIELD of [picture] -> what stands there instead.
    hidden, off : as `runtime.player.Player.change` takes them.
    """

    lights: Mapping[int, LightEdit] = field(default_factory=dict)
    lamps: Mapping[int, LightEdit] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    hidden: frozenset[str] = frozenset()
    off: frozenset[str] = frozenset()

    def of(self, scene: Any) -> Any:
        """Return the scene as it is changed; what is hidden is in it still."""
        lights = tuple(
            self.lights[i].of(light) if i in self.lights else light
            for i, light in enumerate(scene.lights)
        )
        found: dict[str, Any] = {"lights": lights}
        if self.lamps and scene.voxels is not None:
            lamps = tuple(
                self.lamps[i].of(lamp) if i in self.lamps else lamp
                for i, lamp in enumerate(scene.voxels.lamps)
            )
            found["voxels"] = replace(scene.voxels, lamps=lamps)
        if self.values:
            found["picture"] = self._picture(scene.picture)
        return replace(scene, **found)

    def _picture(self, picture: Any) -> Any:
        for path, value in self.values.items():
            table, name = path.split(".")
            described = getattr(picture, table, None)
            # A scene read again may lack the table
            if described is not None and hasattr(described, name):
                picture = replace(picture, **{table: replace(described, **{name: value})})
        return picture

    # changes

    def light(self, number: int, edit: LightEdit, lamp: bool = False) -> Edits:
        """Return these edits with another one of a light, or of a lamp of the world of cubes."""
        which = "lamps" if lamp else "lights"
        found: dict[int, LightEdit] = {**getattr(self, which), number: edit}
        return replace(self, **{which: {n: e for n, e in found.items() if e != LightEdit()}})

    def value(self, path: str, value: Any) -> Edits:
        """Return these edits with another value of [picture]; None is the scene's own."""
        found = {**self.values, path: value}
        return replace(self, values={k: v for k, v in found.items() if v is not None})

    def show(self, name: str, shown: bool) -> Edits:
        """Return these edits with something hidden or shown, such as mesh/NAME."""
        return replace(self, hidden=self.hidden - {name} if shown else self.hidden | {name})

    def effect(self, names: tuple[str, ...], on: bool) -> Edits:
        """Return these edits with effects on or off."""
        return replace(self, off=self.off.difference(names) if on else self.off.union(names))


@dataclass(frozen=True)
class Knob:
    """A number, colour or choice of [picture].

    path : TABLE.FIELD. value : at the moment asked for. keyed : the scene's own value where it may
    move, else None.
    """

    path: str
    spec: Spec
    value: Any
    keyed: Keyed | None

    @property
    def label(self) -> str:
        """Name to show."""
        return self.path.split(".")[1].replace("_", " ")

    def set(self, value: Any) -> Any:
        """Return what stands in the scene for a new value: of what moves all keys are shifted."""
        if self.keyed is None:
            return tuple(value) if isinstance(value, list | tuple) else value
        if self.keyed.constant:
            return Keyed.hold(value)
        by = np.asarray(value, np.float64) - np.asarray(self.value)
        return replace(self.keyed, values=np.clip(self.keyed.values + by, *self._limits))

    @property
    def _limits(self) -> tuple[float, float]:
        return self.spec.low, self.spec.high


def knobs(picture: Any, time: float) -> dict[str, list[Knob]]:
    """Return table -> knobs of all that [picture] describes, as it is at `time` seconds."""
    found: dict[str, list[Knob]] = {}
    for table in fields(picture):
        described = getattr(picture, table.name)
        if is_dataclass(described):
            found[table.name] = [
                _knob(f"{table.name}.{name}", spec, getattr(described, name), time)
                for name, spec in specs(type(described)).items()
                if getattr(described, name) is not None
            ]
    return found


def _knob(path: str, spec: Spec, value: Any, time: float) -> Knob:
    if isinstance(value, Keyed):
        return Knob(path, spec, value.at(time), value)
    return Knob(path, spec, value, None)


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))
