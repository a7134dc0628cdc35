"""How far a change of radiance can move the finished picture, in 8-bit codes, at the worst place.

The film raises radiance by the exposure, runs it through its tone curve, encodes it and multiplies
by 255; a vignette only darkens. Both bounds are the most over every background, which makes them
far from what is seen over bright ones. They hold before the last rounding: two pictures that
differ by c codes there differ by at most ceil(c) as stored. The targets' half floats round besides,
by 0.06 codes a layer.

Derivation. sRGB is concave and 0 at 0, so it moves by at most what it makes of the move itself:
|s(a) - s(b)| <= s(|a - b|). The linear curve clamps, which only shortens moves. The filmic curve
takes mixtures m of the channels (weights sum to 1, so |dm| <= max |dc|), curves each by C(m) = p /
(p + h), p = m^1.3, and takes a share k of the luminance of the results off again, (C - k lum(C)) /
(1 - k): a move of each C by at most d moves it by at most d (1 + k) / (1 - k). Of C itself:
- light added or taken, |dm| <= e: |dC| <= e times the steepest slope of C, which lies at
  p = 0.3 h / 2.3; and never more than 1;
- everything behind a veil, m -> T m: C(m) - C(T m) is largest at p = h T^(-1.3/2), where it is
  (1 - T^0.65) / (1 + T^0.65).

A bloom of strength s makes of each pixel c - s b(c) + s mean(b), b(c) = c max(0, 1 - t / m), t its
threshold and m the largest channel. Without a threshold that is a mean of pixels: it moves by no
more than they do, and a veil over them is one over it. With one:
- light that moves channels by e moves b by (1 - t/m) e + c t/m^2 e <= e, and c - s b by at most
  (1 - s (1 - t/m)) e + s c t/m^2 e <= (1 + s) e: together (1 + 2 s) e;
- with d = c - b, never over t, it is the mean of pixels (1 - s) c + s mean(c), and s (d - mean(d))
  besides. A veil T, V moves d by at most (1 - T) (t + 2 V), both times, and that mean of pixels is
  brighter than the result by at most s t: s (1 - T) (3 t + 4 V) more than over the result.
"""

from typing import TYPE_CHECKING

from maths import colour

if TYPE_CHECKING:
    from formats.scene import Bloom, Film

MOST = 255.0  # codes: no picture differs by more
HALF_FLOAT = 0.06  # codes that rounding a colour to a half float can make, either curve


def added(film: "Film", radiance: float, bloom: "Bloom | None" = None) -> float:
    """The most codes that light moves anywhere, where it adds or takes at most `radiance`.

    radiance : W/(m2 sr) of the channel that changes most, >= 0. Holds at all times.
    """
    raised = radiance * 2.0 ** float(film.exposure.extremes[1])
    if bloom is not None and bloom.threshold > 0.0:
        raised *= 1.0 + 2.0 * float(bloom.strength.extremes[1])
    return _codes(film, raised if film.tonemap == "linear" else _slope() * raised)


def veiled(film: "Film", passing: float, radiance: float, bloom: "Bloom | None" = None) -> float:
    """The most codes that a veil moves anything, of any brightness.

    passing : share of the light behind that comes through, 0..1. radiance : of a veil through which
    nothing comes.
    """
    share = 1.0 - passing
    if share == 0.0:
        return 0.0
    if bloom is not None and bloom.threshold > 0.0:
        strength = float(bloom.strength.extremes[1])
        left = strength * share * (3.0 * bloom.threshold + 4.0 * radiance)
        return min(MOST, veiled(film, passing, radiance) + added(film, left))
    raised = share * radiance * 2.0 ** float(film.exposure.extremes[1])
    if film.tonemap == "linear":
        # Darkened most is what is 1, brightened most is black
        darkened = MOST * float(1.0 - colour.srgb_encode(passing))
        return max(darkened, _codes(film, raised))
    root = passing ** (0.5 * colour.FILMIC_CONTRAST)
    return _codes(film, max((1.0 - root) / (1.0 + root), _slope() * raised))


def _codes(film: "Film", moved: float) -> float:
    """Codes of a move of the curve, before the filmic one gives back its luminance."""
    moved = min(moved, 1.0)
    if film.tonemap == "filmic":
        moved = min(moved * (1.0 + colour.FILMIC_MIX) / (1.0 - colour.FILMIC_MIX), 1.0)
    return MOST if moved >= 1.0 else MOST * float(colour.srgb_encode(moved))


def _slope() -> float:
    """Steepest slope of c^g / (c^g + h)."""
    g, h = colour.FILMIC_CONTRAST, colour.FILMIC_HALF
    p = h * (g - 1.0) / (g + 1.0)
    return float(g * p ** ((g - 1.0) / g) * h / (p + h) ** 2)
