"""What of a scene moves: a field whose keys differ."""

from dataclasses import fields, is_dataclass
from typing import Any

from formats.keyed import Keyed
from formats.scene import Scene


def moving(scene: Scene) -> tuple[str, ...]:
    """Fields that change over time, such as camera.position or lights[0].radiance, in order."""
    parts = ("camera", "lights", "ground", "meshes", "voxels", "billboards", "picture")
    found = tuple(name for part in parts for name in _moving(getattr(scene, part), part))
    lively = (f"particles[{i}]" for i, each in enumerate(scene.particles) if each.emitter.rate > 0)
    return (*found, *(lively if scene.time.duration > 0 else ()))


def _moving(value: Any, name: str) -> list[str]:
    if isinstance(value, Keyed):
        return [] if value.constant else [name]
    if isinstance(value, tuple):
        return [found for i, each in enumerate(value) for found in _moving(each, f"{name}[{i}]")]
    if not is_dataclass(value):
        return []
    return [
        found
        for field in fields(value)
        for found in _moving(getattr(value, field.name), f"{name}.{field.name}")
    ]
