"""`bakelight photographs`: a folder of pictures under known lights becomes a dome."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipelines.cli import build_option, file_path, jobs_option, json_option
from pipelines.price_cli import asked, bake_by_price, free, price_options
from pipelines.single import folder_out, knob

if TYPE_CHECKING:
    from bake.photographs import Space
    from pipelines.bake_sprites import Step

DOME_ALONE = ("space", "bands", "penalty", "channels")
RING_ALONE = ("tolerance", "terms")


@click.command()
@click.argument("source", metavar="LP", type=file_path)
@folder_out
@knob("--space", "linear", "Linear adds up light; stored is for one white light.",
      ("linear", "stored"))  # fmt: skip
@click.option("--hold-out", default="", help="NAME,... or every:N: photographs that no fit sees.")
@knob("--bands", 0, "Bands of harmonics; 0 chooses by held-out error.")
@knob("--penalty", 0.0, "Smoothness; 0 chooses by held-out error.")
@knob("--channels", 16, "Numbers a pixel, four a texture.")
@click.option("--ring", type=float, help="Take only lights about this elevation, degrees: a ring.")
@knob("--tolerance", 10.0, "Ring: degrees that a light may stand off it.")
@knob("--terms", 5, "Ring: circular harmonics kept, odd.")
@price_options
@build_option
@jobs_option
@json_option
def photographs(
    source: Path,
    out: Path,
    space: Space,
    hold_out: str,
    ring: float | None,
    target_error: float | None,
    budget: float | None,
    build: Path,
    jobs: int,
    as_json: bool,
    **knobs: Any,
) -> None:
    """Bake photographs under a dome of lights, named in a .lp file, into 16 numbers a pixel."""
    from bake.store import Store
    from pipelines import bake_sprites, output

    output.use_threads(jobs)
    held = held_out(source, hold_out)
    if ask := asked(target_error, budget):
        from formats.errors import InputError
        from pipelines.price_dome import PhotographsAsset

        if ring is not None:
            remedy = "remove it: only a dome of photographs has a price"
            raise InputError("command line", "--ring", ring, remedy)
        params = dome_steps(held, knobs)[0].params
        subject = PhotographsAsset(source, space, params, bool(free(("channels",))))
        bake_by_price(Store(build / "store"), subject, ask, out, as_json, None)
        return
    if ring is None:
        output.refuse(RING_ALONE, "add --ring ELEVATION, or remove it")
        steps = dome_steps(held, knobs)
    else:
        output.refuse(DOME_ALONE, "remove it: a ring has no such knob")
        steps = ring_steps(held, ring, knobs)
    sprite = bake_sprites.Sprite(bake_sprites.photographs_source(source, space), steps)
    entry = bake_sprites.bake(Store(build / "store"), sprite)
    output.delivered(entry, out, as_json)


def dome_steps(held: tuple[int, ...], knobs: dict[str, Any]) -> tuple[Step, ...]:
    """Return the stage that bakes photographs under a dome with these options."""
    from bake import dome
    from pipelines import bake_sprites

    chosen = {name: knobs[name] for name in ("bands", "penalty", "channels")}
    return (bake_sprites.dome_step(dome.Params(held_out=held, **chosen)),)


def ring_steps(held: tuple[int, ...], elevation: float, knobs: dict[str, Any]) -> tuple[Step, ...]:
    """Return the stages that bake the photographs whose lights lie near an elevation (degrees)."""
    from math import radians

    from bake import mips, photograph_ring
    from formats.errors import InputError
    from pipelines import bake_sprites

    # The stage has radians, which nobody wrote
    for flag, value, top in (("--ring", elevation, 85), ("--tolerance", knobs["tolerance"], 90)):
        if not 0 <= value <= top:
            raise InputError("command line", flag, value, f"write degrees from 0 to {top}")
    params = photograph_ring.Params(
        elevation=radians(elevation),
        tolerance=radians(knobs["tolerance"]),
        terms=knobs["terms"],
        held_out=held,
    )
    # Twelve channels hold five terms or more
    packing = "full" if knobs["terms"] < 5 else "twelve"
    return bake_sprites.ring_of_photographs(params, mips.Params(packing=packing))


def held_out(source: Path, text: str) -> tuple[int, ...]:
    """Return the indices of the photographs that "NAME,..." or "every:N" holds out.

    InputError for names that the file does not have, and for N under 2.
    """
    from formats.errors import InputError
    from formats.files import light_positions

    names = [file.name for file in light_positions.read(source).files]
    if text.startswith("every:"):
        number = text.removeprefix("every:")
        if not (number.isascii() and number.isdigit() and int(number[:9]) >= 2):
            raise InputError("command line", "--hold-out", text, "write every:N with N from 2 up")
        return tuple(range(0, len(names), int(number[:9])))
    wanted = {name.strip() for name in text.split(",") if name.strip()}
    if missing := sorted(wanted - set(names)):
        remedy = f"write names of photographs, such as {names[0]}"
        raise InputError(source, "--hold-out", ", ".join(missing), remedy)
    return tuple(n for n, name in enumerate(names) if name in wanted)
