"""What a plan says: which effects a scene calls for, why, and what they need."""

from dataclasses import asdict, dataclass
from typing import Any

# Effects in frame order; formats/effects.py decides each
FRAME = (
    "environment",
    "lightmap",
    "gather",
    "probe",
    "voxels",
    "surface",
    "transfer",
    "ground",
    "sky",
    "occlusion",
    "fog",
    "silhouette",
    "defocus",
    "particles",
    "billboard",
    "depth_of_field",
    "radial_blur",
    "bloom",
    "film",
)
LINES = 1080  # picture height where none is stated


@dataclass(frozen=True)
class Decision:
    """Whether an effect is called for.

    reason : one sentence.
    bound : how large the effect is at most, in `unit`; None where no number says it. codes : the
    most that leaving it out changes a pixel of the finished picture, of 255; None for 0 where it
    is not called and 255 where it is.
    """

    called: bool
    reason: str
    bound: float | None = None
    unit: str = ""
    codes: float | None = None


@dataclass(frozen=True)
class EffectPlan:
    """A decision about a named effect, after [force], and what the effect costs.

    codes : bound on the error of leaving it out, 8-bit codes of the finished picture. seconds : of
    baking its assets. bytes : of those and of its targets. milliseconds : of its pass a frame;
    timed : "measured" by the last render, or "estimate".
    """

    name: str
    called: bool
    reason: str
    bound: float | None = None
    unit: str = ""
    forced: bool = False
    kinds: tuple[str, ...] = ()
    codes: float = 0.0
    seconds: float = 0.0
    bytes: int = 0
    milliseconds: float = 0.0
    timed: str = "estimate"


@dataclass(frozen=True)
class LightPlan:
    """Whether the player takes a light. index : among the scene's, from 0.

    codes : the most 8-bit codes that it adds to a pixel of the finished picture at any time; None
    where that is not known before its assets are baked.
    """

    index: int
    type: str
    kept: bool
    reason: str
    codes: float | None


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
    """Everything decided about a scene, for pictures at most `lines` pixels high.

    still : nothing moves, so that every frame is the first but for its dither; motion : what does.
    """

    scene: str
    lines: int
    effects: tuple[EffectPlan, ...]
    assets: tuple[AssetPlan, ...]
    sprites: int
    lights: tuple[LightPlan, ...] = ()
    still: bool = False
    motion: str = ""

    @property
    def called(self) -> tuple[str, ...]:
        """Names of the effects called for, in frame order."""
        return tuple(effect.name for effect in self.effects if effect.called)

    @property
    def left_out(self) -> float:
        """The most 8-bit codes that all effects and lights left out together, unforced, change."""
        # The lights of an environment are counted one by one
        effects = [e for e in self.effects if e.name != "environment"]
        codes = [e.codes for e in effects if not (e.called or e.forced)]
        forced = "forced off"
        lights = [each for each in self.lights if not each.kept]
        codes += [each.codes or 0.0 for each in lights if not each.reason.startswith(forced)]
        return sum(codes)

    @property
    def milliseconds(self) -> float:
        """Of a frame."""
        return sum(effect.milliseconds for effect in self.effects if effect.called)

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
        sums = ("kinds", "seconds", "bytes", "milliseconds", "left_out")
        return {**asdict(self), **{name: getattr(self, name) for name in sums}}
