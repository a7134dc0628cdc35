"""Speed and memory against the aims, in one run: `make bench`.

What is compared is measured on the same machine in the same minutes, alternately, and the best of a
few rounds counts, since other work can only slow a round down. Ratios carry over to other machines;
seconds do not.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from time import perf_counter, process_time

import click

from bake import billboard, mips, occlusion
from formats.mesh import Mesh
from pipelines.studies import occlusion_rays, ray_calls
from pipelines.studies.answer import environment
from pipelines.studies.subjects import Setting

SCENES = Path("assets/scenes")
SCENE = SCENES / "grove.toml"
SIZE = (640, 360)
SHARES = (0.2, 0.5, 0.8)  # of a scene's time, at which its passes are measured
FIRST_FRAME = 1.5  # seconds from process start, on 2 cores without a graphics card
ROUNDS = 5
# As a scale, for a statue of 70,000 faces (a --source) on 2 cores: Mitsuba 3 (LLVM) takes 6.2 s for
# 64 directions, 512x512, 16 samples. The knot fills more of its sprite and casts twice its rays.
AIM_SECONDS = 2.5
# 32^3 voxels, 1,024 rays, l_max 4, 16 components
AIM_SHADOWS = 1.35


@dataclass(frozen=True)
class Figure:
    """One number: what, how much, in which unit, and the most that is aimed at."""

    name: str
    value: float
    unit: str
    aim: float | None = None

    @property
    def verdict(self) -> str:
        """Whether the aim is met."""
        return "" if self.aim is None else "met" if self.value < self.aim else "MISSED"


def rays(source: Path | None) -> Iterator[Figure]:
    """A bake against the same Embree calls on ready-made arrays, both with all threads."""
    mesh = subject(source)
    params = billboard.Params()
    recorder = ray_calls.cast(mesh, params, keep=True)
    wall: list[tuple[float, ...]] = []
    work: list[tuple[float, ...]] = []
    for _ in range(ROUNDS):
        moments = [(perf_counter(), process_time())]
        master = billboard.trace(mesh, params=params)
        moments.append((perf_counter(), process_time()))
        mips.pack(master, params=mips.Params())
        moments.append((perf_counter(), process_time()))
        ray_calls.replay(recorder)
        moments.append((perf_counter(), process_time()))
        for kind, times in zip((wall, work), zip(*moments, strict=True), strict=True):
            kind.append(tuple(b - a for a, b in pairwise(times)))
    trace, pack, alone = (min(column) for column in zip(*wall, strict=True))
    traced, _, cast = (min(column) for column in zip(*work, strict=True))
    yield Figure("faces", len(mesh.faces), "")
    yield Figure("rays", recorder.rays, "")
    yield Figure("the Embree calls alone", alone, "s")
    yield Figure("bake: rays to coefficients", trace, "s")
    yield Figure("bake: mips, packing, codes", pack, "s")
    yield Figure("bake, rays to coefficients, over the calls alone", trace / alone, "", 1.5)
    yield Figure("the same in processor time of all threads", traced / cast, "")
    yield Figure("whole bake over the calls alone", (trace + pack) / alone, "")
    yield Figure("whole bake", trace + pack, "s", None if source is None else AIM_SECONDS)


def memory(source: Path | None) -> Iterator[Figure]:
    """Peak memory of a bake with 16 and with 256 lights, each in a process of its own."""
    peaks = []
    for lights in (16, 256):
        code = "import sys; from pipelines.studies.bench import peak; peak(*sys.argv[1:])"
        words = [
            sys.executable,
            "-c",
            code,
            str(lights),
            *([] if source is None else [str(source)]),
        ]
        peaks.append(int(_run(words)) / 2**20)
        yield Figure(f"peak memory, {lights} lights", peaks[-1], "MiB")
    yield Figure("memory of 256 lights over that of 16", peaks[1] / peaks[0], "", 1.05)


def peak(lights: str, source: str = "") -> None:
    """Bake once and print the peak of this process' memory meanwhile, in bytes."""
    mesh = subject(Path(source) if source else None)
    # Reading the mesh may take more than baking it: Linux can forget that peak
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    billboard.trace(mesh, params=billboard.Params(lights=int(lights)))
    print(peak_bytes())


def peak_bytes() -> int:
    """Return the peak of this process' resident memory, in bytes."""
    with suppress(OSError):
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return 1024 * int(status.split("VmHWM:")[1].split()[0])
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (
        1 if sys.platform == "darwin" else 1024
    )


def commands(source: Path | None) -> Iterator[Figure]:
    """The program from process start: a bake with nothing to do, and the first frame."""
    del source
    program = [sys.executable, "-c", "from pipelines.cli import main; main()"]
    _run([*program, "bake", str(SCENE)])
    yield Figure(
        "no-op bake of the grove", best_of(lambda: _run([*program, "bake", str(SCENE)])), "s", 0.5
    )
    with tempfile.TemporaryDirectory() as folder:
        out = f"{folder}/frame.png"
        for scene in scenes():
            _run([*program, "bake", str(scene)])
            words = ["-m", "pipelines.studies.first_frame", str(scene), out, *map(str, SIZE)]
            seconds = best_of(partial(_run, [sys.executable, *words]))
            yield Figure(f"first frame of {scene.stem}, written", seconds, "s", FIRST_FRAME)


def frames(source: Path | None) -> Iterator[Figure]:
    """Milliseconds of a frame of each scene and of its passes: medians, every pass drawn."""
    del source
    from formats.scene import load
    from pipelines import profile
    from pipelines.studies.first_frame import gathered
    from runtime.player import Player

    for scene in scenes():
        folder = Path("build/scenes") / scene.stem
        with Player(folder, size=SIZE, roaming=gathered(load(scene))) as player:
            duration = player.scene.time.duration
            found = profile.measure(player, [share * duration for share in SHARES])
        how = f"{SIZE[0]}x{SIZE[1]}, {found['renderer']}, {found['timing']}"
        yield Figure(f"{scene.stem}: frame ({how})", found["frame"]["milliseconds"], "ms")
        for row in found["table"]:
            yield Figure(f"{scene.stem}: pass {row['name']}", row["milliseconds"], "ms")


def scenes() -> list[Path]:
    """Return the scenes of the checkout."""
    return sorted(SCENES.glob("*.toml"))


def shadows(source: Path | None) -> Iterator[Figure]:
    """The bake of an occlusion volume against its own Embree calls, one thread."""
    found = occlusion_rays.overhead(subject(source), occlusion.Params(), ROUNDS)
    yield Figure("rays of an occlusion volume", found["rays"], "")
    yield Figure("the Embree calls alone, and the tree", found["calls"] + found["build"], "s")
    yield Figure("occlusion volume, whole bake", found["whole"], "s")
    yield Figure("whole bake of the volume over the calls", found["ratio"], "", AIM_SHADOWS)


PARTS: dict[str, Callable[[Path | None], Iterator[Figure]]] = {
    "rays": rays,
    "memory": memory,
    "commands": commands,
    "frames": frames,
    "shadows": shadows,
}


def subject(source: Path | None) -> Mesh:
    """Return the mesh to bake: the user's own, or a coloured knot of 70,000 faces."""
    return next(iter(Setting(source=source).meshes("knot").values()))


def best_of(action: Callable[[], object]) -> float:
    """Return the seconds of the fastest of a few rounds."""
    seconds = []
    for _ in range(ROUNDS):
        started = perf_counter()
        action()
        seconds.append(perf_counter() - started)
    return min(seconds)


def _run(words: list[str]) -> str:
    """Run a program as users have it: with the bytecode of its modules kept."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return subprocess.run(words, check=True, capture_output=True, text=True, env=kept).stdout


@click.command()
@click.option("--source", type=click.Path(path_type=Path, exists=True), help="A mesh of your own.")
@click.option("--only", type=click.Choice(list(PARTS)), multiple=True, help="Some parts alone.")
@click.option(
    "-o",
    "--output",
    "out",
    type=click.Path(path_type=Path),
    default=Path("build/studies"),
    show_default=True,
)
def main(source: Path | None, only: tuple[str, ...], out: Path) -> None:
    """Measure, print a table, and write bench.json."""
    from rich.console import Console
    from rich.table import Table

    figures = [figure for name in only or PARTS for figure in PARTS[name](source)]
    table = Table("what", "measured", "aim", "")
    for one in figures:
        aim = "" if one.aim is None else f"< {one.aim:g} {one.unit}"
        table.add_row(one.name, f"{one.value:.4g} {one.unit}", aim, one.verdict)
    Console().print(table)
    out.mkdir(parents=True, exist_ok=True)
    data = {
        "source": None if source is None else source.name,
        **environment(),
        "figures": [asdict(one) | {"verdict": one.verdict} for one in figures],
    }
    (out / "bench.json").write_text(
        json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8"
    )
    click.echo(str(out / "bench.json"))


if __name__ == "__main__":
    main()
