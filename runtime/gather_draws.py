"""The draws of a gather: a pass of rays, what surfaces hand on, the lightmap, and changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from maths.hashing import pcg
from runtime import gather_schedule, light_uniforms
from runtime.gather_targets import UNITS, Targets
from runtime.shader import SCREEN, Programs, set_uniforms
from runtime.voxel_lamps import FreeLamp, Lamps
from runtime.voxel_world import Change, VoxelVolume

PASSES = Path(__file__).parent / "passes"
FADE = 4.0
"""Passes by which half of what was shown before a change is gone."""
KEEP = 2.0 ** (-1 / 3)
"""Of light handed on, each ray, while light settles."""
CALM = 256.0
"""Passes after a change until which texels take from their neighbours."""
BOXES = 16
"""Boxes of a change; more are taken for one."""


class Draws:
    """Programs and uniforms. defines : flags of the rays; cast : uniforms that never change;
    settled : pairs of passes after a change until means count."""

    def __init__(
        self,
        ctx: Any,
        programs: Programs,
        targets: Targets,
        defines: Mapping[str, Any],
        cast: Mapping[str, Any],
        settled: int,
    ) -> None:
        self._ctx, self._targets, self._cast = ctx, targets, cast
        self._programs, self._defines, self._settled = programs, defines, settled
        self._arrays: dict[tuple[str, int], Any] = {}
        for name in ("gather", "gather_send", "gather_change"):
            self._array(name, 0)

    def _array(self, name: str, how: int) -> Any:
        """Return a draw, whose program is linked when it is first asked for."""
        if (name, how) not in self._arrays:
            flags = {
                "gather": {**self._defines, "AIMED": how},
                "gather_show": {"DOWNSAMPLE": how},
                "gather_change": {"BOXES": BOXES},
            }
            path = PASSES / f"{name}.frag"
            program = self._programs.get(SCREEN, path, flags.get(name, {}), {})
            self._arrays[name, how] = self._ctx.vertex_array(program, [])
        return self._arrays[name, how]

    def cast(
        self,
        number: int,
        pair: gather_schedule.Pair,
        volume: VoxelVolume,
        lamps: Lamps,
        seed: int,
        free: Sequence[FreeLamp] = (),
        lights: Any = None,
    ) -> None:
        """Add a pair of passes, the one of this number. lights : of the scene, in cells."""
        lit = self.passes_per_ray(lamps, free) > 1
        common = {
            **self._cast,
            "scale": volume.scale,
            "settled": 2.0 * self._settled,
            "keep": KEEP,
            "blend": pair.blend,
            "counts": float(pair.counts),
            "passes_per_ray": self.passes_per_ray(lamps, free),
            "lamp_count": lamps.count,
            "lamp_power": lamps.power,
            "cube_place": [(*lamp.middle, lamp.half_side) for lamp in free],
            "cube_light": [lamp.radiance for lamp in free],
            **({} if lights is None else light_uniforms.of(lights)),
        }
        for k in (0, 1):
            # Lamps and cosine take turns: a set is a pair; without lamps, a pass
            chosen = (number if lit else k) & 1
            values = {
                "pass_index": number >> 1 if lit else number,
                "swap": k,
                "set_sign": 1.0 - 2.0 * chosen,
                "offset": _words(seed, chosen, 0),
                "aim_offset": _words(seed, chosen, 1),
                "light_offset": _words(seed, chosen, 2),
            }
            self._targets.use()
            _use(volume.world, "world")
            _use(volume.gaps, "gaps")
            _use(lamps.table, "lamps")
            _use(lamps.destinations, "destinations")
            # A whole pass has rays of one kind: where rays run side by side none waits for others
            self._draw("gather", self._targets.turned(), {**common, **values}, int(lit and k == 0))

    def passes_per_ray(self, lamps: Lamps, free: Sequence[FreeLamp]) -> float:
        """Return how many passes there are for a ray along the cosine: others are aimed."""
        return 2.0 if (lamps.count > 0 or bool(free)) and lamps.destinations is None else 1.0

    def send(self, what: str, volume: VoxelVolume, *, one_by_one: bool) -> None:
        """Let surfaces hand on what a schedule says. one_by_one : bounces are built up."""
        self._targets.use()
        _use(volume.rows, "rows")
        _use(volume.palette, "palette")
        # What did not change for long hands on its mean
        chain = 2.0 * gather_schedule.CHAIN * self._settled
        values = {
            "settled": 1e30 if one_by_one else chain,
            "bounced": 0.0 if what == "glows" else 1.0,
            # Bounces that are built up stay for many passes: nothing old may get into them
            "remembered": 0.0 if one_by_one else 1.0,
            "fade": 1.0 / FADE,
        }
        self._draw("gather_send", self._targets.sent_buffer, values)

    def show(self, buffer: Any, downsample: int, *, calm: bool) -> None:
        """Draw the lightmap, with means of so many texels along a side of a cell; calm : texels
        whose sums began anew lately take from their neighbours."""
        self._targets.use()
        values = {"fade": 1.0 / FADE, "calm": CALM if calm else 0.0}
        self._draw("gather_show", buffer, values, downsample)

    def change(self, changes: Sequence[Change], least: float) -> None:
        """Begin anew where these boxes may change irradiance by more than `least`."""
        if len(changes) > BOXES:
            changes = [_all_of(changes)]
        low, high = (np.array([getattr(c, side) for c in changes]) for side in ("low", "high"))
        middle = np.zeros((BOXES, 4))
        middle[: len(low), :3] = (low + high) / 2
        middle[: len(low), 3] = np.linalg.norm(high - low, axis=1) / 2
        values = {
            "count": len(changes),
            "middle": [tuple(row) for row in middle],
            "radiance": [c.radiance for c in changes] + [0.0] * (BOXES - len(changes)),
            "least": least,
            "fade": 1.0 / FADE,
        }
        self._targets.use()
        self._draw("gather_change", self._targets.changed(), values)

    def release(self) -> None:
        """Free vertex arrays; programs belong to who gave them."""
        for array in self._arrays.values():
            array.release()

    def _draw(self, name: str, target: Any, values: Mapping[str, Any], how: int = 0) -> None:
        array = self._array(name, how)
        set_uniforms(array.program, {**UNITS, **values})
        self._ctx.enable_only(moderngl.NOTHING)
        target.use()
        array.render(mode=moderngl.TRIANGLES, vertices=3)


def _use(texture: Any, name: str) -> None:
    if texture is not None:
        texture.use(UNITS[name])


def _words(seed: int, chosen: int, kind: int) -> tuple[int, ...]:
    """Shifts of a set and a kind of rays."""
    return tuple(int(word) for word in pcg(seed, chosen, kind, np.arange(4)))


def _all_of(changes: Sequence[Change]) -> Change:
    low = np.min([c.low for c in changes], axis=0).tolist()
    high = np.max([c.high for c in changes], axis=0).tolist()
    return Change(tuple(low), tuple(high), max(c.radiance for c in changes))
