# ruff: noqa: RUF009 -- item() is dataclasses.field() with the schema as its metadata
"""Particles in a scene: where they are born, how they move, what they look like."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import schema
from formats.keyed import Keyed
from formats.schema import Where, item
from formats.sprites import Billboards, complete
from maths import particles

Array = NDArray[np.float64]
MOST = 100_000  # alive at a time: 27 MB of arrays while they are placed, 6 MB of records
SEED_MAX = 2**32 - 1
SPEED: dict[str, Any] = {"unit": "m/s", "sizes": (3,), "low": -1e4, "high": 1e4}
DEGREES: dict[str, Any] = {"sizes": (2,), "low": -36000, "high": 36000}


@dataclass(frozen=True, kw_only=True)
class Emitter:
    """Where and when particles are born, and how long they live."""

    seed: int = item("integer", "another seed, other particles", 0, low=0, high=SEED_MAX)
    rate: float = item("number", "births", unit="1/s", low=0, high=1e6)
    lifetime: tuple[float, float] = item(
        "vector", "least and most", unit="s", sizes=(2,), low=1e-2, high=1e4
    )
    centre: Keyed = item(
        "keyed", "of the box of births, at their time", unit="m", sizes=(3,), low=-1e6, high=1e6
    )
    half_size: tuple[float, float, float] = item(
        "vector", "of that box", [0.0, 0.0, 0.0], unit="m", sizes=(3,), low=0, high=1e6
    )
    period: float = item(
        "number",
        "after which births repeat, so that an animation loops; 0: never",
        0.0,
        unit="s",
        low=0,
        high=1e5,
    )

    @property
    def cycle(self) -> int:
        """Births of a period, 0 without one."""
        return max(1, round(self.rate * self.period)) if self.rate * self.period > 0.0 else 0

    @property
    def pace(self) -> float:
        """Births a second: the rate, or what is next to it and makes whole births a period."""
        return self.cycle / self.period if self.cycle else self.rate


@dataclass(frozen=True, kw_only=True)
class Motion:
    """How particles move: Newton's law with drag, and a wander."""

    velocity: tuple[float, float, float] = item("vector", "at birth", [0.0, 0.0, 0.0], **SPEED)
    spread: tuple[float, float, float] = item(
        "vector", "by which that differs at most, by chance", [0.0, 0.0, 0.0], **SPEED
    )
    acceleration: tuple[float, float, float] = item(
        "vector",
        "of gravity, heat or wind",
        [0.0, 0.0, 0.0],
        unit="m/s2",
        sizes=(3,),
        low=-1e4,
        high=1e4,
    )
    drag: float = item(
        "number", "share of the speed lost a second", 0.0, unit="1/s", low=0, high=1e3
    )
    turbulence: float = item(
        "number", "stray at most along each axis, none at birth", 0.0, unit="m", low=0, high=1e4
    )
    turbulence_scale: float = item(
        "number", "of about one turn of the stray", 1.0, unit="s", low=1e-2, high=1e4
    )


@dataclass(frozen=True, kw_only=True)
class Look:
    """A soft glowing disc, or the sprites of a set."""

    radius: float | tuple[float, float] | None = item(
        "value",
        "of a disc, or its least and most",
        None,
        unit="m",
        sizes=(1, 2),
        low=1e-5,
        high=1e3,
    )
    radiance: tuple[float, float, float] = item(
        "vector",
        "of the middle of a disc",
        [1.0, 1.0, 1.0],
        unit="W/(m2 sr)",
        sizes=(3,),
        low=0,
        high=1e6,
    )
    edge: float = item("number", "share of a disc's radius that is soft", 0.8, low=0, high=1)
    billboard: str | None = item("text", "a set instead of a disc, by its name", None)
    scale: float | tuple[float, float] = item(
        "value", "factor on the height of the set, or its least and most", 1.0, sizes=(1, 2),
        low=1e-3, high=1e3,
    )  # fmt: skip
    opacity: float | None = item(
        "number",
        "factor on alpha; 0 only adds light. Absent: 0 of a disc, 1 of a set",
        None,
        low=0,
        high=1,
    )
    softness: float = item(
        "number", "over which it fades before what is opaque", 0.0, unit="m", low=0, high=100
    )
    fade: tuple[float, float] = item(
        "vector",
        "shares of its life to appear and to vanish",
        [0.1, 0.3],
        sizes=(2,),
        low=0,
        high=1,
    )
    roll: tuple[float, float] = item(
        "vector", "least and most turn of a picture at birth", [0.0, 0.0], unit="deg", **DEGREES
    )
    spin: tuple[float, float] = item(
        "vector", "least and most turn of a picture a second", [0.0, 0.0], unit="deg/s", **DEGREES
    )
    tint: float = item(
        "number", "amount of variation of the colour: 1 varies it by half", 0.0, low=0, high=1
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Particles:
    """Many small things in the air, each a closed form of seed, number and time."""

    name: str = item("text", "of the particles; letters, digits, - and _")
    emitter: Emitter = item("table", "births", table=Emitter)
    motion: Motion = item("table", "motion", {}, table=Motion)
    look: Look = item("table", "looks", table=Look)

    @property
    def most(self) -> int:
        """No more are alive at any moment."""
        return particles.most(self.emitter.pace, self.emitter.lifetime)

    @property
    def factor(self) -> tuple[float, float]:
        """Least and most factor on the height of the set, or of a disc 1 m high."""
        if self.look.billboard is None:
            return _pair(self.look.radius or 0.0, 2.0)
        return _pair(self.look.scale, 1.0)

    @property
    def dark(self) -> bool:
        """Whether nothing of a disc shows."""
        plain = self.look.billboard is None
        return plain and not any(self.look.radiance) and not self.look.opacity

    def box(self) -> tuple[Array, Array]:
        """Corners (3,), (3,) of a box that holds the middle of each at every moment."""
        half = np.array(self.emitter.half_size)
        low, high = (np.asarray(end) for end in self.emitter.centre.extremes)
        motion = self.motion
        return particles.reach(
            low - half,
            high + half,
            motion.velocity,
            motion.spread,
            motion.acceleration,
            motion.drag,
            motion.turbulence,
            self.emitter.lifetime[1],
        )

    def disc(self) -> Billboards:
        """The set of discs where the look names none; it has no places of its own."""
        opacity = self.look.opacity or 0.0
        made = Billboards(
            name=f"particles/{self.name}",
            source=Path("disc.png"),
            height=1.0,
            radiance=self.look.radiance,
            opacity=opacity,
            facing="camera",
        )
        return complete(made, 0)


def _pair(value: float | tuple[float, ...], times: float) -> tuple[float, float]:
    low, high = value if isinstance(value, tuple) else (value, value)
    return times * low, times * high


def check(found: Particles, billboards: Collection[Billboards], where: Where) -> None:
    """Refuse what only several fields, and the sets of the scene, show to be wrong."""
    emitter, look = found.emitter, found.look
    for table, key, ends in (
        ("emitter", "lifetime", emitter.lifetime),
        ("look", "radius", look.radius),
        ("look", "scale", look.scale),
        ("look", "roll", look.roll),
        ("look", "spin", look.spin),
    ):
        if isinstance(ends, tuple) and ends[0] > ends[1]:
            where.at(table).at(key).refuse(list(ends), "write the lesser first")
    if found.most > MOST:
        fits = MOST / emitter.lifetime[1]
        remedy = f"write at most {fits:.4g}, or a shorter lifetime: {MOST:,} may live at a time"
        where.at("emitter").at("rate").refuse(emitter.rate, remedy)
    place = where.at("look")
    if look.billboard is None:
        if look.radius is None:
            place.at("radius").refuse("missing", "add it: of a disc (m), or name a billboard")
        return
    names = {each.name: each for each in billboards}
    if look.billboard not in names:
        remedy = schema.suggestion(look.billboard, list(names)) if names else "add [[billboards]]"
        place.at("billboard").refuse(look.billboard, remedy)
    for key in ("radius", "radiance", "edge"):
        given = getattr(look, key)
        if given is not None and not np.array_equal(given, schema.specs(Look)[key].default):
            place.at(key).refuse(
                given, "remove this line: it is of a disc, and a billboard is named"
            )
    turns = [key for key in ("roll", "spin") if getattr(look, key) != (0.0, 0.0)]
    if turns and not names[look.billboard].pictured:
        remedy = "remove this line: only a picture turns, what is lit does not"
        place.at(turns[0]).refuse(list(getattr(look, turns[0])), remedy)
