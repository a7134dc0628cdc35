"""`bakelight photographs`: a folder of pictures under known lights becomes a dome."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipelines.cli import build_option, file_path, jobs_option, json_option
from pipelines.single import folder_out, knob

if TYPE_CHECKING:
    from bake.dome import Params
    from bake.photographs import Space
    from bake.recipe import Entry
    from bake.store import Store


@click.command()
@click.argument("source", metavar="LP", type=file_path)
@folder_out
@knob("--space", "linear", "Linear adds up light; stored is for one white light.",
      ("linear", "stored"))  # fmt: skip
@click.option("--hold-out", default="", help="NAME,... or every:N: photographs that no fit sees.")
@knob("--bands", 0, "Bands of harmonics; 0 chooses by held-out error.")
@knob("--penalty", 0.0, "Smoothness; 0 chooses by held-out error.")
@knob("--channels", 16, "Numbers a pixel, four a texture.")
@build_option
@jobs_option
@json_option
def photographs(
    source: Path,
    out: Path,
    space: Space,
    hold_out: str,
    build: Path,
    jobs: int,
    as_json: bool,
    **knobs: Any,
) -> None:
    """Bake photographs under a dome of lights, named in a .lp file, into 16 numbers a pixel."""
    from bake import dome
    from bake.store import Store
    from formats import report
    from pipelines import output

    output.use_threads(jobs)
    params = dome.Params(held_out=held_out(source, hold_out), **knobs)
    entry = bake_dome(Store(build / "store"), source, space, params)
    if not as_json:
        click.echo(compared(report.read(entry.path)["quality"]))
    output.delivered(entry, out, as_json)


def bake_dome(store: Store, source: Path, space: Space, params: Params) -> Entry:
    """Bake the dome of a `.lp` file, or find it in the store."""
    from functools import partial

    from bake import dome, photographs
    from bake.recipe import Source
    from formats.files import light_positions

    files = dict.fromkeys(light_positions.read(source).files)
    load = partial(photographs.load, source, space=space)
    return store.run(dome.fit, Source((source, *files), load), params=params)


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


def compared(quality: dict[str, Any]) -> str:
    """Return in a line how well unseen lights are met, and how two other methods meet them."""
    held = "held_out_psnr" in quality
    prefix = "held_out" if held else "leave_one_out"
    what = f"{quality['held_out_lights']} held-out lights" if held else "lights left out in turn"
    figures = [
        f"{name} {quality[key]:.2f} dB"
        for name, key in (
            ("this", f"{prefix}_psnr"),
            ("PTM (18 numbers)", f"{prefix}_ptm_18_psnr"),
            ("HSH (27)", f"{prefix}_hsh_27_psnr"),
        )
        if key in quality
    ]
    return f"{what}: " + ", ".join(figures)
