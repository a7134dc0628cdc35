"""When a scene calls for what is done to the finished radiance: radial blur and bloom.

Bloom scatters what is brighter than its threshold. Where nothing in the scene can be, it changes
nothing; otherwise it moves a pixel by at most its strength times what the brightest thing has over
the threshold. The brightest thing is bounded by the sum of what every light makes on anything, of
the sky, of the fog, of pictures and of particles. Meshes that emit, cubes, and tables that are not
known here bound nothing.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from formats import film_bounds
from formats.light_bounds import most_radiance
from formats.meshes import KINDS, shown
from formats.plan import Decision
from formats.poses import WIDEST
from formats.scene import Scene

Reports = Mapping[str, Mapping[str, Any]]
CODES = "8-bit codes"
LEAST_CODES = 0.5
LEAST_PIXELS = 0.5  # a streak that is no longer is left as it is
SUN_DISC = 3.0  # most radiance of the sky's sun over its glow
ROUNDING = 1.02  # of half floats, a few layers of them
# What `brightest` counts; any other part of a scene may be of any brightness
COUNTED = {
    *("format", "time", "quality", "camera", "lights", "ground", "meshes", "billboards"),
    *("particles", "picture", "force"),
}
COUNTED_IN_PICTURE = {"sky", "fog", "film", "bloom", "radial_blur"}


def has_streaks(scene: Scene) -> bool:
    """Whether the scene describes a radial blur."""
    return scene.picture.radial_blur is not None


def radial_blur(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Streaks towards a point, where the longest reaches half a pixel."""
    blur = scene.picture.radial_blur
    if blur is None:
        return Decision(False, "the scene has no picture.radial_blur")
    strength = float(blur.strength.extremes[1])
    x, y = (max(share, 1.0 - share) for share in blur.centre)
    longest = strength * lines * float(np.hypot(WIDEST * x, y))
    reason = f"the longest streak has {longest:.3g} px of {lines} lines"
    # What is shorter is left as it is, in every pixel
    return Decision(longest >= LEAST_PIXELS, reason, longest, "px")


def bloom(scene: Scene, reports: Reports, lines: int) -> Decision:
    """Light scattered around what is bright, where something may exceed the threshold."""
    described = scene.picture.bloom
    if described is None:
        return Decision(False, "the scene has no picture.bloom")
    strength = float(described.strength.extremes[1])
    if strength == 0.0:
        return Decision(False, "the strength of picture.bloom is 0", 0.0, CODES, codes=0.0)
    most = brightest(scene, reports)
    if most is None:
        return Decision(True, "no bound is known on what is brightest")
    over = most - described.threshold
    if over <= 0.0:
        reason = f"nothing is brighter than {most:.3g}, under the threshold"
        return Decision(False, reason, 0.0, CODES, codes=0.0)
    codes = film_bounds.added(scene.picture.film, strength * over)
    reason = f"what is brightest has at most {over:.3g} over the threshold"
    return Decision(codes >= LEAST_CODES, reason, codes, CODES, codes)


def brightest(scene: Scene, reports: Reports) -> float | None:
    """No pixel is brighter at any time in any channel, W/(m2 sr); None where no bound is known."""
    known = set(scene.raw) <= COUNTED and set(scene.raw.get("picture", {})) <= COUNTED_IN_PICTURE
    emits = [
        reports.get(f"{KINDS[mesh.lighting]}/{mesh.name}", {}).get("emissive", True)
        for mesh in shown(scene)
    ]
    if not known or any(emits):
        return None
    found = [most_radiance(scene, reports, light) for light in scene.lights]
    lit = [each for each in found if each is not None]
    own = _own(scene, reports)
    if len(lit) < len(found) or own is None:
        return None
    return ROUNDING * (sum(lit) + own + _air(scene))


def _own(scene: Scene, reports: Reports) -> float | None:
    """The most radiance of pictures and discs that lie over one another; None where one may have
    any."""
    total = 0.0
    for found in scene.billboards:
        count = 0.0
        instances = found.instances()
        if len(instances):
            count += len(instances) * float(instances.tint.max())
        for each in scene.particles:
            if each.look.billboard == found.name:
                count += each.most * (1.0 + 0.5 * each.look.tint)
        if not (found.pictured and count):
            continue
        layout = reports.get(f"billboard/{found.name}", {}).get("layout")
        # Codes of a PNG are 1 at most
        if layout is None and found.source.suffix.lower() != ".png":
            return None
        brightest = 1.0 if layout is None else float(layout["brightest"])
        total += count * brightest * max(found.radiance)
    for each in scene.particles:
        if each.look.billboard is None:
            total += each.most * (1.0 + 0.5 * each.look.tint) * max(each.look.radiance)
    return total


def _air(scene: Scene) -> float:
    """The most radiance of sky and fog."""
    sky, fog = scene.picture.sky, scene.picture.fog
    most = 0.0
    if sky is not None:
        most += max(float(np.max(each.extremes[1])) for each in (sky.zenith, sky.horizon))
        if sky.glow is not None:
            most += SUN_DISC * float(np.max(sky.glow.extremes[1]))
    return most + (0.0 if fog is None else float(np.max(fog.radiance.extremes[1])))
