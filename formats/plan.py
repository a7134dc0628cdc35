"""What a plan says: which effects a scene calls for, why, and what they need."""

from dataclasses import asdict, dataclass
from typing import Any

# Effects in frame order; formats/effects.py decides each
FRAME = ("environment", "ground", "sky", "fog", "billboard", "depth_of_field", "film")
LINES = 1080  # picture height where none is stated


@dataclass(frozen=True)
class Decision:
    """Whether an effect is called for.

    reason : one sentence.
    bound : how large the effect is at most, in `unit`; None where no number says it.
    """

    called: bool
    reason: str
    bound: float | None = None
    unit: str = ""


@dataclass(frozen=True)
class EffectPlan:
    """A decision about a named effect, after [force]."""

    name: str
    called: bool
    reason: str
    bound: float | None = None
    unit: str = ""
    forced: bool = False
    kinds: tuple[str, ...] = ()


@dataclass(frozen=True)
class AssetPlan:
    """One thing to bake.

    name : kind/set, such as billboard/oak or environment/0 (number among the lights).
    source : as the scene writes it. seconds : of the bake; known : measured before, not estimated.
    bytes : in the memory of the graphics card, estimated.
    """

    name: str
    kind: str
    source: str
    seconds: float
    known: bool
    bytes: int


@dataclass(frozen=True)
class Plan:
    """Everything decided about a scene, for pictures `lines` pixels high."""

    scene: str
    lines: int
    effects: tuple[EffectPlan, ...]
    assets: tuple[AssetPlan, ...]
    sprites: int

    @property
    def called(self) -> tuple[str, ...]:
        """Names of the effects called for, in frame order."""
        return tuple(effect.name for effect in self.effects if effect.called)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of assets that the called effects need, each once, in frame order."""
        return tuple(
            dict.fromkeys(kind for effect in self.effects if effect.called for kind in effect.kinds)
        )

    @property
    def seconds(self) -> float:
        """Of baking every asset from nothing."""
        return sum(asset.seconds for asset in self.assets)

    @property
    def bytes(self) -> int:
        """Of all assets in the memory of the graphics card."""
        return sum(asset.bytes for asset in self.assets)

    def as_dict(self) -> dict[str, Any]:
        """For JSON and manifests."""
        return {**asdict(self), "kinds": self.kinds, "seconds": self.seconds, "bytes": self.bytes}
