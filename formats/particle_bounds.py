"""When a scene calls for particles: where any is born that may be seen."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from formats.lens_bounds import clouds
from formats.plan import Decision
from formats.poses import poses
from formats.scene import Scene

Reports = Mapping[str, Mapping[str, Any]]
CODES = "8-bit codes"


def particles(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Particles, where any of them may show in any view."""
    if not scene.particles:
        return Decision(False, "the scene has no [[particles]]", 0.0, "particles")
    shining = [each for each in scene.particles if each.most and not each.dark]
    if not shining:
        return Decision(False, "none is ever born, or all are dark", 0.0, CODES)
    count = sum(each.most for each in shining)
    reason = f"at most {count:,} live at a time"
    sets = {f"billboard/{each.look.billboard}" for each in shining if each.look.billboard}
    # A lens spreads them farther than they reach
    known = scene.camera.lens is None and sets <= set(reports)
    if known and not _seen(scene, reports):
        return Decision(False, f"{reason}, out of every view", 0.0, CODES)
    return Decision(True, reason, float(count), "particles")


def _seen(scene: Scene, reports: Reports) -> bool:
    half = scene.camera.sensor_height_mm / 2000.0
    unforced = replace(scene, force={})
    found = [(middle, radius) for _, middle, radius in clouds(unforced, reports)]
    return any(
        bool(pose.depths(middle, radius, half)[0].any())
        for pose in poses(scene)
        for middle, radius in found
    )


def drawn(scene: Scene, reports: Reports, lines: int) -> bool:
    """Whether particles are called for, after [force]."""
    forced = scene.force.get("particles")
    return particles(scene, reports, lines).called if forced is None else forced
