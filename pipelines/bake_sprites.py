"""How one set of sprites is baked: from a mesh or from photographs, under a ring or under a dome.

Each way is a short chain of stages, each an entry of the store: a knob of the last stage, such as
the lens, does not trace a mesh again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bake import mips, recipe, sources
from bake.recipe import Baked, Entry, Source, Stage
from bake.store import Store, seconds_of
from formats import photograph_files, picture_files
from formats.coefficients import Coefficients
from formats.effects import largest_lod
from formats.mesh import Mesh
from formats.scene import Scene
from formats.sprites import Billboards

if TYPE_CHECKING:
    from bake.photographs import Space

Watch = Callable[[float], None]


@dataclass(frozen=True)
class Step:
    """A stage with its knobs; load : how the next stage reads what it leaves."""

    stage: Stage
    params: Any
    load: Callable[[Path], Any]


@dataclass(frozen=True)
class Sprite:
    """Where a set of sprites comes from, and the stages that bake it."""

    source: Source[Any]
    steps: tuple[Step, ...]


def of_scene(scene: Scene, group: Billboards) -> Sprite:
    """Return how a scene's set is baked. InputError where its source cannot be read."""
    if group.pictured:
        return _picture(scene, group)
    if group.photographed:
        lines = photograph_files.size(group.source)[1]
        source: Source[Any] = photographs_source(group.source)
        if group.dome is None:
            return Sprite(
                source, ring_of_photographs(ring_params(group), _pack(scene, group, lines))
            )
        return Sprite(source, (dome_step(_dome(scene, group, lines)),))
    source = mesh_source(group.source)
    if group.dome is None:
        return Sprite(source, ring_of_mesh(_trace(group), _pack(scene, group, group.resolution)))
    steps = dome_of_mesh(_renders(group), _dome(scene, group, group.resolution))
    return Sprite(source, steps)


def _picture(scene: Scene, group: Billboards) -> Sprite:
    from bake import picture
    from formats.picture import Picture

    lines = picture_files.baked_size(group.source, group.resolution)[1]
    lod = _max_lod(scene, group, lines, picture.Params.filter)
    params = picture.of_file(group.source, group.resolution, lod)
    source = Source((group.source,), partial(picture.load, group.source))
    return Sprite(source, (Step(picture.prepare, params, Picture.load),))


def bake(store: Store, sprite: Sprite, watch: Watch | None = None) -> Entry:
    """Bake a sprite, each stage its own entry; what the store has is not baked again."""
    entries = located(store, sprite)
    # What the player reads is there already: do not even check what it was made from
    there = all(entry.hit for entry in entries)
    given: recipe.Input = sprite.source
    last = len(entries) - 1
    for n, (step, entry) in enumerate(zip(sprite.steps, entries, strict=True)):
        if n == last or not there:
            told = watch if n == 0 else None
            entry = store.run(step.stage, given, params=step.params, on_progress=told)
        given = Baked(entry, step.load)
    return entry


def located(store: Store, sprite: Sprite) -> tuple[Entry, ...]:
    """Return where each stage's entry is or would be, and whether it is there, without checking its
    bytes."""
    given: recipe.Input = sprite.source
    entries = []
    for step in sprite.steps:
        contents = recipe.of(step.stage, (given,), step.params)
        key = recipe.key(contents)
        path = store.folder / f"{contents['stage']}-{key}"
        entries.append(Entry(path, key, path.is_dir(), seconds_of(path)))
        given = Baked(entries[-1], step.load)
    return tuple(entries)


def mesh_source(path: Path) -> Source[Mesh]:
    """Return a mesh file as the input of a stage. InputError where it is none."""
    sources.check_file(path)
    return Source(sources.files(path), partial(sources.load, path))


def photographs_source(path: Path, space: Space = "linear") -> Source[Any]:
    """Return a `.lp` file and its photographs as the input of a stage. InputError."""
    from bake import photographs

    return Source(photograph_files.files(path), partial(photographs.load, path, space=space))


def ring_of_mesh(trace: Any, pack: mips.Params) -> tuple[Step, ...]:
    """Rays, then mips and codes. trace : bake.billboard.Params."""
    from bake import billboard
    from formats.billboard import Billboard

    return (
        Step(billboard.trace, trace, Coefficients.load),
        Step(mips.pack, pack, Billboard.load),
    )


def ring_of_photographs(fit: Any, pack: mips.Params) -> tuple[Step, ...]:
    """A fit, then mips and codes. fit : bake.photograph_ring.Params."""
    from bake import photograph_ring
    from formats.billboard import Billboard

    return (
        Step(photograph_ring.fit, fit, Coefficients.load),
        Step(mips.pack, pack, Billboard.load),
    )


def dome_of_mesh(render: Any, fit: Any) -> tuple[Step, ...]:
    """Renders, then a fit. render, fit : Params of bake.dome_renders and of bake.dome."""
    from bake import dome_renders
    from bake.photographs import Photographs

    return (Step(dome_renders.render, render, Photographs.load), dome_step(fit))


def dome_step(fit: Any) -> Step:
    """The fit of photographs or renders. fit : bake.dome.Params."""
    from bake import dome
    from formats.dome import Dome

    return Step(dome.fit, fit, Dome.load)


def ring_params(group: Billboards) -> Any:
    """Turn what a scene says of the ring of photographs into bake.photograph_ring.Params."""
    from bake import photograph_ring

    assert group.ring is not None
    return photograph_ring.Params(
        elevation=float(np.radians(group.ring.elevation)),
        tolerance=float(np.radians(group.ring.tolerance)),
        terms=group.ring.terms,
    )


def _traced(group: Billboards) -> dict[str, Any]:
    """Return the knobs that rays have under a ring and under a dome."""
    return {
        "resolution": group.resolution,
        "views": group.views,
        "samples": group.samples,
        "sun_diameter": float(np.radians(group.sun_diameter)),
        "sky_fill": group.sky_fill,
        "transmission": group.transmission,
        "gloss": group.gloss,
    }


def _trace(group: Billboards) -> Any:
    from bake import billboard

    assert group.ring is not None
    return billboard.Params(
        **_traced(group),
        axis=group.ring.axis,
        elevation=float(np.radians(group.ring.elevation)),
        lights=group.ring.lights,
        terms=group.ring.terms,
    )


def _renders(group: Billboards) -> Any:
    from bake import dome_renders

    assert group.dome is not None
    return dome_renders.Params(**_traced(group), lights=group.dome.lights)


def _dome(scene: Scene, group: Billboards, lines: int) -> Any:
    from bake import dome

    assert group.dome is not None
    return dome.Params(
        bands=group.dome.bands,
        penalty=group.dome.penalty,
        channels=group.dome.channels,
        coverage=True,
        max_lod=_max_lod(scene, group, lines),
    )


def _pack(scene: Scene, group: Billboards, lines: int) -> mips.Params:
    return mips.Params(
        max_lod=_max_lod(scene, group, lines),
        packing="full" if group.packing == "full" else "twelve",
        unpack="talk" if group.packing == "talk" else "chroma",
    )


def _max_lod(scene: Scene, group: Billboards, lines: int, filter: str = "") -> float:
    """Return the coarsest level that the lens asks of a set of `lines` texels along its height."""
    scale = mips.FILTERS[filter or mips.Params().filter].lens_scale
    lod = largest_lod(scene, group, lines / group.height, scale)
    # Whole levels: a small change of the lens then bakes nothing anew
    return float(min(7, np.ceil(lod)))
