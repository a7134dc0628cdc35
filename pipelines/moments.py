"""Which moments a render shows, and the names of their files."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from formats.errors import InputError
from formats.scene import Scene
from formats.schema import MAX_SECONDS

MOVIES = (".gif", ".webp", ".mp4")
MAX_FRAMES = 1_000_000
_NUMBERED = re.compile(r"#+|%0?(\d{0,2})d")


@dataclass(frozen=True)
class Moment:
    """One picture to make: seconds, and the name of its file in a folder.

    number : of the frame; None for a time. spread : whether it is one of several.
    """

    time: float
    name: str
    number: int | None = None
    spread: bool = False


def chosen(scene: Scene, times: tuple[float, ...], frames: str | None, out: Path) -> list[Moment]:
    """List the moments that --time or --frames ask for. Raises InputError where they make no sense.

    out : must be able to hold them: a movie wants frames, several times a folder, and a numbered
    name (`name.####.exr`, `name.%04d.exr`) frames.
    """
    numbered = _NUMBERED.search(out.name) is not None
    if frames is not None and times:
        raise InputError("command line", "--frames", frames, "give either --frames or --time")
    if frames is None:
        if numbered:
            remedy = "a numbered name needs --frames A:B"
            raise InputError("command line", "--output", str(out), remedy)
        return _stills(scene, times, out)
    if numbered and out.suffix.lower() in ("", *MOVIES):
        remedy = "end a numbered name in .png or .exr"
        raise InputError("command line", "--output", str(out), remedy)
    match = re.fullmatch(r"(\d{1,12}):(\d{1,12})(?::(\d{1,12}))?", frames)
    first, last, step = (int(n or 1) for n in match.groups()) if match else (0, 0, 0)
    if not (last > first and step):
        remedy = "write A:B or A:B:STEP with A < B, such as 0:48"
        raise InputError("command line", "--frames", frames, remedy)
    numbers = range(first, last, step)
    if len(numbers) > MAX_FRAMES:
        raise InputError("command line", "--frames", frames, f"ask for at most {MAX_FRAMES:,}")
    rate = scene.time.frame_rate
    return [Moment(n / rate, f"{scene.name}-{n:05d}", n, len(numbers) > 1) for n in numbers]


def _stills(scene: Scene, times: tuple[float, ...], out: Path) -> list[Moment]:
    asked = tuple(dict.fromkeys(times)) or (0.0,)
    for time in asked:
        if not abs(time) <= MAX_SECONDS:
            remedy = f"give seconds, at most {MAX_SECONDS:.0f}"
            raise InputError("command line", "--time", time, remedy)
    if len(asked) > 1 and out.suffix:
        raise InputError("command line", "--output", str(out), "name a folder for several times")
    if out.suffix.lower() in MOVIES:
        raise InputError("command line", "--output", str(out), "a movie needs --frames A:B")
    stamps = zip(_stamps(asked), asked, strict=True)
    return [Moment(time, f"{scene.name}-{stamp}", spread=len(asked) > 1) for stamp, time in stamps]


def target(out: Path, moment: Moment) -> Path:
    """Return the file of a moment, its folder made.

    A numbered name has the frame's number in place of `####`, as wide as there are `#`.
    """
    suffix = out.suffix.lower()
    found = out
    if moment.number is not None and _NUMBERED.search(out.name):
        found = out.with_name(numbered_name(out.name, moment.number))
    elif not suffix or moment.spread:
        folder = out.parent / out.stem if suffix else out
        found = folder / f"{moment.name}{suffix or '.png'}"
    found.parent.mkdir(parents=True, exist_ok=True)
    return found


def numbered_name(pattern: str, number: int) -> str:
    """Put a number into a name.

    >>> numbered_name("moth.####.exr", 7), numbered_name("moth.%03d.exr", 7)
    ('moth.0007.exr', 'moth.007.exr')
    """

    def written(match: re.Match[str]) -> str:
        width = len(match[0]) if match[0][0] == "#" else int(match[1] or 0)
        return f"{number:0{width}d}"

    return _NUMBERED.sub(written, pattern, count=1)


def _stamps(times: tuple[float, ...]) -> list[str]:
    """Write times with as many decimals, two at least, as tell them all apart.

    >>> _stamps((0.5, 12.0))
    ['000.50', '012.00']
    """
    for decimals in range(2, 17):
        stamps = [f"{time:0{decimals + 4}.{decimals}f}" for time in times]
        if len(set(stamps)) == len(times):
            break
    return stamps
