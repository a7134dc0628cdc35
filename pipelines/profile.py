"""What a frame costs, pass by pass: milliseconds, programs, textures, bytes and draw calls."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import quantiles
from time import perf_counter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

FRAMES = 9  # measured, each twice: pass by pass, and as a whole
FEWEST, SECONDS = 3, 10.0  # stop early after so many frames and seconds
COUNTS = ("programs", "textures", "bytes", "draw_calls")


def measure(player: Any, times: Sequence[float], frames: int = FRAMES) -> dict[str, Any]:
    """Draw frames at `times` seconds in turn, every pass of each; return the player's profile and:

    table : one row a pass, in the order of drawing, with name, milliseconds (median), low and high
    (its quartiles), programs, textures, bytes, draw_calls; `start` is camera and lights, and the
    targets that all passes share; `resolve` the mean of the samples; the first that draws also
    clears. frame : milliseconds of whole frames, nothing measured within. frames : how many.
    """
    reused, player.reuse = player.reuse, False
    whole: list[float] = []
    spent: dict[str, list[float]] = {}
    try:
        # The first frame compiles, the second still fills caches
        for _ in range(2):
            player.draw(times[0])
        started = perf_counter()
        while len(whole) < frames:
            if len(whole) >= FEWEST and perf_counter() - started > SECONDS:
                break
            time = times[len(whole) % len(times)]
            player.draw(time)
            for name, milliseconds in player.targets.milliseconds.items():
                spent.setdefault(name, []).append(milliseconds)
            with player.targets.timed("frame"):
                player.draw(time)
            whole.append(player.targets.milliseconds.pop("frame"))
    finally:
        player.reuse = reused
    found = dict(player.profile)
    counts = found.pop("by_pass")
    none = dict.fromkeys(COUNTS, 0)
    rows = [{"name": name, **_spread(spent[name]), **counts.get(name, none)} for name in spent]
    total = {name: sum(row[name] for row in rows) for name in ("milliseconds", *COUNTS)}
    found["milliseconds"] = {row["name"]: row["milliseconds"] for row in rows}
    return found | {
        "table": rows,
        "total": total,
        "frame": _spread(whole),
        "frames": len(whole),
        "times": list(times[: len(whole)]),
    }


def show(profile: dict[str, Any], console: Console | None = None) -> None:
    """Print a profile as a table; in colour only on a terminal and without NO_COLOR."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    console = console or Console()
    width, height = profile["size"]
    title = f"{width}x{height}, {profile['renderer']}"
    # Eighty columns hold it whole
    table = Table(title=title, title_justify="left", show_footer=True, box=box.SIMPLE)
    table.add_column("pass", "sum", no_wrap=True)
    names = ["ms", "quartiles", "programs", "textures", "MB", "draws"]
    for name, footer in zip(names, _cells(profile["total"], ""), strict=True):
        table.add_column(name, footer, justify="right", no_wrap=True)
    for row in profile["table"]:
        quartiles = f"{row['low']:.2f} - {row['high']:.2f}"
        table.add_row(row["name"], *_cells(row, quartiles))
    console.print(table)
    frame, total = profile["frame"], profile["total"]["milliseconds"]
    console.print(
        f"A whole frame: {frame['milliseconds']:.2f} ms "
        f"({frame['low']:.2f} - {frame['high']:.2f}); sum of its passes: {total:.2f} ms.\n"
        f"Medians of {profile['frames']} frames, every pass drawn; {profile['timing']}.",
        highlight=False,
    )


def _cells(row: dict[str, Any], quartiles: str) -> list[str]:
    counts = [str(row["programs"]), str(row["textures"]), f"{row['bytes'] / 1e6:.2f}"]
    return [f"{row['milliseconds']:.2f}", quartiles, *counts, str(row["draw_calls"])]


def _spread(values: list[float]) -> dict[str, float]:
    low, middle, high = quantiles(values, n=4, method="inclusive")
    return {"milliseconds": middle, "low": low, "high": high}
