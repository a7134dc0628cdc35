"""The report of a sprite in a few lines, as a person would want it; `--json` has everything."""

from __future__ import annotations

from math import degrees, pi
from typing import Any

OTHERS = (("ptm_18", "PTM of 18 numbers"), ("hsh_27", "HSH of 27"))
STEPS = (
    ("packing", "packing of terms"),
    ("channels", "fewer numbers"),
    ("coverage", "coverage"),
    ("bits", "8 bits"),
)


def lines(data: dict[str, Any]) -> list[str]:
    """Return what the report of a billboard or dome says, notes last; none for other kinds."""
    kind, quality = data.get("kind"), data.get("quality", {})
    if kind not in ("billboard", "dome"):
        return []
    layout = data["layout"]
    what = _dome(layout, quality) if kind == "dome" else _ring(layout, quality)
    size = f", {data['bytes'] / 1e6:.2g} MB" if "bytes" in data else ""
    sealed = f", seal {data['seal']}" if "seal" in data else ""
    found = [what + size + sealed, *good(quality)]
    found += [f"fit: {', '.join(_fit(quality))}", f"range: {_range(quality, kind)}"]
    return [*found, *(f"note: {note}" for note in quality.get("notes", []))]


def good(quality: dict[str, Any]) -> list[str]:
    """Return how well lights are met, beside other methods, and what each step costs."""
    found = [f"error: {compared(quality)}"]
    lost = [f"{text} {quality[key]:.2f} dB" for name, text in STEPS
            if (key := f"loss_{name}_db") in quality]  # fmt: skip
    return [*found, f"lost by: {', '.join(lost)}"] if lost else found


def compared(quality: dict[str, Any]) -> str:
    """Return in a line how well unseen lights are met, and how two other methods meet them."""
    told = []
    for prefix, what in (
        ("held_out", f"{quality.get('held_out_lights', '')} held-out lights".strip()),
        ("leave_one_out", f"{quality.get('lights', '')} lights left out in turn".strip()),
        ("fitted", "the lights that were fitted"),
    ):
        if f"{prefix}_psnr" in quality:
            figures = _figures(quality, prefix)
            if prefix == "leave_one_out":
                # Of the fit in floats: what is left out in turn was never compressed
                figures[0] += " before losses"
            told.append(f"{what}: " + ", ".join(figures))
    rms = quality.get("leave_one_out_rms")
    if not told and rms is not None:
        told.append(f"lights left out in turn: RMS {rms:.2g}")
    return "; ".join(told[:1]) if told else "not known"


def _figures(quality: dict[str, Any], prefix: str) -> list[str]:
    found = [f"this {quality[f'{prefix}_psnr']:.2f} dB"]
    for name, text in OTHERS:
        if (key := f"{prefix}_{name}_psnr") in quality:
            found.append(f"{text} {quality[key]:.2f} dB")
    return found


def _ring(layout: dict[str, Any], quality: dict[str, Any]) -> str:
    ring = layout["ring"]
    photographed = quality.get("source") == "photographs"
    of = "photographs" if photographed else "a mesh"
    lights = f"{ring['lights']} lights"
    if photographed and "lights_of_the_set" in quality:
        low, high = quality["lowest_light_degrees"], quality["highest_light_degrees"]
        lights += f" of {quality['lights_of_the_set']}, at {low:.0f} to {high:.0f} degrees,"
    planes = f"{len(layout['scales'])} textures ({layout['packing']})"
    return (
        f"{of} under a ring: {lights} about {degrees(ring['elevation']):.3g} degrees (axis "
        f"{ring['axis']}), {ring['terms']} terms in {planes}{_views(layout)}"
    )


def _dome(layout: dict[str, Any], quality: dict[str, Any]) -> str:
    coverage = " and coverage" if layout.get("coverage") else ""
    planes = len(layout["scales"])
    return (
        f"{quality.get('lights', 'some')} pictures under a dome: {layout['channels']} numbers a "
        f"pixel{coverage} in {planes} textures, {layout['space']} values{_views(layout)}"
    )


def _views(layout: dict[str, Any]) -> str:
    return f", {layout['views']} views" if layout.get("views", 1) > 1 else ""


def _fit(quality: dict[str, Any]) -> list[str]:
    """Return the knobs that were chosen and how firm the ground is."""
    named = (
        ("bands", "{} bands"),
        ("penalty", "penalty {:g}"),
        ("weight_exponent", "dark values weighted by the power {:g}"),
        ("terms_used", "{} terms used"),
        ("condition", "condition {:.3g}"),
        ("largest_gap_degrees", "largest gap {:.0f} degrees"),
    )
    return [text.format(quality[key]) for key, text in named if key in quality]


def _range(quality: dict[str, Any], kind: str) -> str:
    """Return the extremes of relit values, 1 being a white sheet that faces its sun."""
    white = 1.0 if kind == "dome" else pi
    found = []
    if "minimum" in quality:
        found.append(f"lowest relit value {quality['minimum'] * white:.3g} of a white sheet's 1")
    if "maximum" in quality:
        found.append(f"highest {quality['maximum'] * white:.3g}")
    if "negative_texels" in quality:
        found.append(f"{quality['negative_texels']:.1%} of texels go below 0 somewhere")
    return ", ".join(found) or "not known"
