"""Particles as sets of sprites whose places are made anew for each moment."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maths import particles as motion
from runtime.sprites import SpriteSet


@dataclass(frozen=True)
class Disc:
    """What stands in for the picture of a disc: 1 m wide, and no texture.

    edge : share of its radius that is soft.
    """

    edge: float
    height = metres_per_texel = 1.0
    size = (1, 1)
    pivot = (0.5, 1.0)
    planes = views = 1
    lens_scale = max_lod = 0.0
    levels = (None,)


def disc_set(found: Any) -> Any:
    """Return a set of no sprites yet that draws discs."""
    none = np.empty(0)
    return SpriteSet(
        name=f"particles/{found.name}",
        asset=Disc(found.look.edge),
        series=None,
        texture=None,
        positions=np.empty((0, 3)),
        scale=none,
        yaw=none,
        flip=np.empty(0, bool),
        tint=np.empty((0, 3)),
        shadow=False,
        boxes=np.empty((0, 4)),
        roll=none,
        pivot=(0.5, 0.5),
        softness=found.look.softness,
        upright=False,
        middle=0.0,
        moving=True,
    )


def of_set(found: Any, sprites: Any) -> Any:
    """Return a set of no sprites yet that draws particles with the texture of another."""
    asset = sprites.asset
    # About its middle, wherever its own sprites stand
    pivot = asset.pivot[0], asset.pivot[1] - 0.5 * asset.height / asset.metres_per_texel
    none = np.empty(0)
    return replace(
        sprites,
        name=f"particles/{found.name}",
        positions=np.empty((0, 3)),
        scale=none,
        yaw=none,
        roll=none,
        flip=np.empty(0, bool),
        tint=np.empty((0, 3)),
        opacity=none,
        shadow=False,
        pivot=pivot,
        softness=found.look.softness,
        middle=0.0,
        moving=True,
    )


def fill(sprites: Any, found: Any, billboards: Any, time: float) -> None:
    """Put a set's sprites where particles are at `time` seconds.

    billboards : the set as the scene describes it.
    """
    emitter, how, look = found.emitter, found.motion, found.look
    seed = emitter.seed
    alive = motion.alive(seed, emitter.pace, emitter.lifetime, time, emitter.cycle)
    index, n = alive.index, len(alive.index)
    sprites.positions = motion.positions(
        seed,
        alive,
        lambda born: emitter.centre.sampled(born),
        emitter.half_size,
        how.velocity,
        how.spread,
        how.acceleration,
        how.drag,
        how.turbulence,
        how.turbulence_scale,
    )
    shown = motion.fade(alive.share, *look.fade)
    sprites.scale = motion.between(found.factor, motion.chance(seed, index, 4)) * (
        billboards.height / sprites.asset.height
    )
    roll = motion.between(look.roll, motion.chance(seed, index, 5))
    roll += motion.between(look.spin, motion.chance(seed, index, 6)) * alive.age
    sprites.roll = np.radians(roll)
    sprites.flip = (motion.chance(seed, index, 7) < 0.5) & (look.billboard is not None)
    sprites.yaw = 2.0 * np.pi * motion.chance(seed, index, 8)
    vary = 0.5 * motion.chance(seed, index, 9)[:, None] + 0.25 * motion.chances(seed, index, 3, 10)
    tint = 1.0 + look.tint * (vary - 0.25)
    radiance = billboards.radiance if billboards.pictured else np.ones(3)
    sprites.tint = tint * (np.asarray(radiance) * shown[:, None])
    own = billboards.opacity if look.opacity is None else look.opacity
    sprites.opacity = np.full(n, own) * shown
