"""The options --target-error and --budget of every command that bakes, and what they print."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from pipelines import start

if TYPE_CHECKING:
    from bake.store import Store
    from pipelines.price import Ask, Deal, Subject, Watch

Command = TypeVar("Command", bound=Callable[..., Any])

TARGET = click.option(
    "--target-error",
    type=float,
    metavar="E",
    help="Choose knobs for this relative error, such as 0.05, by a short probe.",
)
BUDGET = click.option(
    "--budget",
    type=float,
    metavar="SECONDS",
    help="Choose knobs for the least error in this time, probe and check included.",
)


def price_options(command: Command) -> Command:
    """Give a command both options, as the arguments `target_error` and `budget`."""
    return TARGET(BUDGET(command))


def asked(target_error: float | None, budget: float | None) -> Ask:
    """Return what is asked for; false where nothing is. InputError for what cannot be."""
    from pipelines.price import Ask

    ask = Ask(target_error, budget)
    ask.check()
    return ask


def free(names: Iterable[str]) -> tuple[str, ...]:
    """Return those options of the running command that the user did not write."""
    from click.core import ParameterSource

    source = click.get_current_context().get_parameter_source
    return tuple(name for name in names if source(name) != ParameterSource.COMMANDLINE)


def refuse_written(names: Iterable[str]) -> None:
    """Raise InputError for the first of these options that the user wrote: the price chooses."""
    from formats.errors import InputError

    names = tuple(names)
    chosen = free(names)
    for name in names:
        if name not in chosen:
            flag = "--" + name.replace("_", "-")
            value = click.get_current_context().params[name]
            raise InputError("command line", flag, value, "remove it: the price chooses it")


def bake_by_price(
    store: Store, subject: Subject, ask: Ask, out: Path, as_json: bool, watch: Watch | None
) -> None:
    """Bake an asset as asked for, put it into the folder `out` and say what came of it."""
    from formats import report, seal
    from pipelines import output, price
    from pipelines.deliver import deliver

    entry, deal = price.buy(subject, store, ask, watch)
    told = deal.as_dict()

    def amend(folder: Path) -> None:
        report.write(folder, report.read(folder) | {"price": told})
        seal.seal(folder)

    deliver(entry.path, out, amend)
    quality = report.read(entry.path).get("quality", {})
    if as_json:
        output.dump({
            "folder": str(out), "hit": entry.hit, "seconds": entry.seconds, "quality": quality,
            "price": told,
        })  # fmt: skip
        return
    for line in deal.lines():
        click.echo(line)
    for note in (*quality.get("notes", []), *missed(deal)):
        click.echo(f"note: {start.plain(note)}", err=True)
    click.echo(str(out))


def missed(deal: Deal) -> list[str]:
    """Return a note where the check found more than was asked for, error or seconds."""
    found, ask = [], deal.asked
    if ask.target is not None and deal.reached is not None and deal.reached.value > ask.target:
        found.append(f"error {deal.reached.value:.2%} misses the {ask.target:.2%} asked for")
    if ask.budget is not None and deal.spent > 1.2 * ask.budget:
        found.append(f"took {deal.spent:.1f} s of {ask.budget:g} s asked for")
    return found


def watch_of(bar: Callable[[str, float], None] | None, source: Path) -> Watch | None:
    """Return what a stage tells its progress."""
    return None if bar is None else partial(bar, source.name)


__all__ = ["asked", "bake_by_price", "free", "missed", "price_options", "refuse_written"]


def bake_scene(
    scene: Path, root: Path | None, build: Path, only: str | None, target_error: float | None,
    budget: float | None, as_json: bool,
) -> bool:  # fmt: skip
    """Bake a scene by price and say what came of it; False where nothing is asked for."""
    ask = asked(target_error, budget) if (target_error, budget) != (None, None) else None
    if not ask:
        return False
    from formats.errors import InputError
    from pipelines import output, price_scene

    if only is not None:
        raise InputError("command line", "--only", only, "remove it: a price is the whole scene's")
    with output.bars() as bar:
        found = price_scene.bake(scene, ask, root=root, build_folder=build, on_progress=bar)
    if as_json:
        entries = found.done.entries.items()
        assets = {
            name: {"hit": e.hit, "seconds": e.seconds, "key": e.key, "folder": str(e.path)}
            for name, e in entries
        }
        folder = str(found.done.folder)
        output.dump({"folder": folder, "assets": assets, "price": found.as_dict()})
        return True
    for name, deal in found.deals.items():
        click.echo(f"{name}")
        for line in deal.lines():
            click.echo(f"  {line}")
        for note in missed(deal):
            click.echo(f"note: {name}: {start.plain(note)}", err=True)
    click.echo(f"in all: {found.seconds:.1f} s")
    if ask.budget is not None and found.seconds > 1.2 * ask.budget:
        click.echo(f"note: {ask.budget:g} s were asked for", err=True)
    click.echo(f"{found.done.folder}")
    return True
