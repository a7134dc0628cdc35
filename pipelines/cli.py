"""The command line: parse, call, print. Every error a user can cause is one line and an exit code.

Exit codes: 0; 1 our bug; 2 input; 3 machine (no OpenGL, disk full); 4 damaged asset; 130
interrupted.
"""

from __future__ import annotations

import errno
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, TextIO

import click

from formats.errors import BakelightError
from pipelines import price_cli, start

BUILD = Path("build")
file_path = click.Path(path_type=Path)
build_option = click.option(
    "--build",
    type=file_path,
    default=BUILD,
    show_default=True,
    help="Folder of store, scenes, renders.",
)
root_option = click.option(
    "--root",
    type=file_path,
    default=None,
    help="Asset root; default: the folder that holds scenes/.",
)
jobs_option = click.option(
    "--jobs", type=click.IntRange(0), default=0, help="Threads; 0: one a core."
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON on standard output.")


def _kind(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Check a kind of baked asset against the table of effects, read only where one is named."""
    if value is None:
        return None
    from formats.effects import EFFECTS

    kinds = sorted({kind for row in EFFECTS for kind in row.kinds})
    return str(click.Choice(kinds).convert(value, param, ctx))


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="bakelight")
def cli() -> None:
    """Bake light ahead of time, then play it back."""


@cli.command()
@click.argument("scene", type=file_path)
@root_option
@build_option
@jobs_option
@click.option(
    "--only",
    metavar="KIND",
    callback=_kind,
    help="Bake one kind of asset alone, such as lightmap, with what it is made from.",
)
@price_cli.price_options
@json_option
def bake(
    scene: Path, root: Path | None, build: Path, jobs: int, only: str | None,
    target_error: float | None, budget: float | None, as_json: bool,
) -> None:  # fmt: skip
    """Bake what SCENE calls for into build/scenes/NAME."""
    from pipelines import output, unchanged

    asked = (only, target_error, budget)
    if asked == (None, None, None) and (found := unchanged.look(scene, root, build)):
        output.baked(found, as_json)
        return
    from pipelines.bake_scene import bake_scene

    output.use_threads(jobs)
    if price_cli.bake_scene(scene, root, build, only, target_error, budget, as_json):
        return
    with output.bars() as bar:
        done = bake_scene(scene, root=root, build_folder=build, only=only, on_progress=bar)
    output.baked(done, as_json)


@cli.command()
@click.argument("scene", type=file_path)
@root_option
@build_option
@click.option(
    "--lines",
    type=click.IntRange(1, 16384),
    default=1080,
    help="Picture height that bounds are for.",
)
@price_cli.price_options
@json_option
def plan(
    scene: Path, root: Path | None, build: Path, lines: int, target_error: float | None,
    budget: float | None, as_json: bool,
) -> None:  # fmt: skip
    """Tell which effects SCENE calls for, which not, why, and what they cost."""
    from pipelines import output

    ask = price_cli.asked(target_error, budget)
    output.planned(scene, root, build, lines, as_json, ask)


@cli.command()
@click.argument("scene", type=file_path)
@click.option(
    "-o", "--output", "out", type=file_path, required=True, help="File or folder (ends with /)."
)
@click.option("--size", default="1280x720", show_default=True, help="Width x height in pixels.")
@click.option(
    "--time", "times", type=float, multiple=True, help="Seconds; several give several stills."
)
@click.option(
    "--frames",
    help="A:B or A:B:STEP, frame numbers from A to before B: a sequence (name.####.png or a "
    "folder), .gif, .webp, .mp4.",
)
@click.option(
    "--layers", metavar="NAMES",
    help="Of an .exr, beside its light: all, or some of depth, position, normal, id, coverage, "
    "opaque, sprites, before_post, with commas.",
)  # fmt: skip
@click.option(
    "--quality", type=click.IntRange(1, 100), default=80, show_default=True,
    help="Of .webp and .mp4.",
)  # fmt: skip
@click.option("--skip-existing", is_flag=True, help="Leave pictures that are there already.")
@click.option("--profile", is_flag=True, help="Print what each pass costs.")
@click.option(
    "--reference", is_flag=True, help="Trace the scene by paths, as the truth; no OpenGL."
)
@click.option(
    "--samples", type=click.IntRange(2, 65536), default=64, show_default=True,
    help="Paths a pixel of --reference.",
)  # fmt: skip
@root_option
@build_option
@jobs_option
@json_option
def render(
    scene: Path, out: Path, size: str, times: tuple[float, ...], frames: str | None,
    layers: str | None, quality: int, skip_existing: bool, profile: bool, reference: bool,
    samples: int, root: Path | None, build: Path, jobs: int, as_json: bool,
) -> None:  # fmt: skip
    """Render SCENE without a window: .png, .exr (linear), sequence, .gif, .webp or .mp4."""
    start.to_draw()
    from pipelines import output
    from pipelines.render_scene import Options, render_scene, trace_scene

    output.use_threads(jobs)
    if not reference:
        output.refuse(("samples",), "add --reference, or remove it")
    if out.suffix.lower() not in (".webp", ".mp4"):
        output.refuse(("quality",), "remove it: only .webp and .mp4 have it")
    options = Options(layers, quality, skip_existing)
    if reference:
        traced = trace_scene(
            scene, out, size=size, times=times, frames=frames, samples=samples, root=root,
            build_folder=build, options=options,
        )  # fmt: skip
        output.traced(traced, as_json=as_json)
        return
    job = render_scene(
        scene, out, size=size, times=times, frames=frames, root=root, build_folder=build,
        measured=profile, options=options,
    )  # fmt: skip
    output.rendered(job, as_json=as_json, profile=profile)


@cli.command()
@click.argument("scene", type=file_path)
@click.option("--size", default="1280x720", show_default=True, help="Width x height in pixels.")
@root_option
@build_option
@jobs_option
@json_option
def view(scene: Path, size: str, root: Path | None, build: Path, jobs: int, as_json: bool) -> None:
    """Open SCENE in a window that follows its files: look, play, light, compare; F1 lists keys."""
    from pipelines import output
    from pipelines.render_scene import parse_size
    from pipelines.view_scene import view_scene

    output.use_threads(jobs)
    view_scene(
        scene, size=parse_size(size), root=root, build_folder=build, threads=jobs, as_json=as_json
    )


@cli.command()
@click.argument("questions", nargs=-1)
@click.option("-o", "--output", "out", type=file_path, default=BUILD / "studies", show_default=True)
@click.option("--quick", is_flag=True, help="Fewer points and smaller pictures: all in 5 minutes.")
@click.option(
    "--source",
    type=file_path,
    default=None,
    help="A mesh, photographs (.lp), voxels (.vox) or a scene of your own instead of ours.",
)
@click.option("--again", is_flag=True, help="Measure again what is kept from an earlier run, too.")
@json_option
def study(
    questions: tuple[str, ...],
    out: Path,
    quick: bool,
    source: Path | None,
    again: bool,
    as_json: bool,
) -> None:
    """Measure error against time; without QUESTIONS, all. `study list` names them.

    What was measured before is kept, so that an interrupted run goes on where it stopped; all
    answers stand in index.html of the output folder.
    """
    from pipelines.studies import run

    run.run(questions, out, quick=quick, source=source, again=again, as_json=as_json)


def main() -> None:
    """Run the command line; the process's exit code says what went wrong."""
    start.streams()
    start.lean()
    try:
        from pipelines import single

        single.add_to(cli)
        code = run(sys.argv[1:])
    except KeyboardInterrupt:
        code = 130
    sys.exit(_flushed(code))


def _flushed(code: int) -> int:
    """Write out what is buffered, while an error can still be told; return the exit code."""
    try:
        sys.stdout.flush()
    except OSError as error:
        # A command that met it itself has said so
        if not isinstance(error, BrokenPipeError):
            code = code or _say(*_refused(error))
        _drop(sys.stdout)
    try:
        sys.stderr.flush()
    except OSError:
        _drop(sys.stderr)
    return code


def _drop(stream: TextIO) -> None:
    """Let what a stream still holds go nowhere: leaving would flush, and fail, again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def run(arguments: list[str]) -> int:
    """Run one command and return its exit code; never a traceback for what a user can cause."""
    try:
        result: Any = cli.main(args=arguments, prog_name="bakelight", standalone_mode=False)
        return result if isinstance(result, int) else 0
    except BakelightError as error:
        return _say(str(error), error.exit_code)
    except click.ClickException as error:
        error.show()
        return 2
    except (KeyboardInterrupt, click.Abort):
        return _say("interrupted; what was finished is kept", 130)
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except OSError as error:
        return _say(*_refused(error))
    except SystemExit:
        # Only click and rich leave so, where the reader of a pipe is gone
        return 0
    except MemoryError:
        return _say("not enough memory -- lower the resolution or the number of lights", 3)


def _refused(error: OSError) -> tuple[str, int]:
    """Return message and exit code for what the file system refused: bad path or bad machine."""
    reason, file = error.strerror or str(error), error.filename or "output"
    if isinstance(error, FileExistsError | NotADirectoryError | IsADirectoryError):
        return f"{file}: {reason} -- name another file or folder", 2
    if error.errno in (errno.ENAMETOOLONG, errno.ELOOP):
        return f"{file}: {reason} -- name another file or folder", 2
    if isinstance(error, PermissionError):
        remedy = "check its permissions and its folder's, or choose another place"
        return f"{file}: {reason} -- {remedy}", 3
    return f"{file}: {reason} -- choose a place with room that can be written", 3


def _say(message: str, code: int) -> int:
    """Print one line on standard error, whatever names hold, if that can still be written."""
    with suppress(OSError):
        click.echo(f"bakelight: {start.plain(message)}", err=True)
    return code


if __name__ == "__main__":
    main()
