"""Relit sprites: sorted back to front, premultiplied, lit by their own light's harmonics.

Reads the opaque depth; writes colour. Blur by the lens is a coarser mip level, never added to the
one that distance asks for: level = max(hardware level, log2(c * circle of confusion in texels)).
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from maths import optics
from runtime import reuse, sprite_shadows
from runtime.shader import set_uniforms

HERE = Path(__file__).parent
RECORD_ROW = 1024  # texels of a row of the table of records
FAINT = 1 / 512  # of the brightest sun: its shadows would change less than half an 8-bit code
# Rows of light that fit in varyings. A dome's 15 would fill all that ES 3.00 has; on llvmpipe they
# made large sprites half as slow again as looking them up
IN_VERTEX = 9


class Pass:
    """Draws every sprite of the scene."""

    reads = ("depth",)
    writes = ("colour",)

    def __init__(self, player: Any) -> None:
        self._player = player
        self._ctx, self._frame = player.ctx, player.targets
        self._sets = player.sprites
        self._lens = "depth_of_field" in player.called
        self._fog = "fog" in player.called
        self._defocus = "defocus" in player.called
        self._arrays = [self._array(s.defines) for s in self._sets]
        self._decoding = [s.decoding() for s in self._sets]
        self._lighting = player.sprite_lighting
        self._records: Any = None
        # Instances of all sets in one list: set number and number within the set
        self._set = np.concatenate(
            [np.full(len(s.positions), i) for i, s in enumerate(self._sets)] or [np.empty(0)]
        ).astype(np.int64)

    def _array(self, defines: dict[str, int]) -> Any:
        both = {
            **defines,
            "LENS": self._lens,
            "RECORD_ROW": RECORD_ROW,
            "LIGHT_IN_VERTEX": defines["TERMS"] <= IN_VERTEX,
        }
        in_vertex = {k: v for k, v in both.items() if k not in ("PLANES", "PACKING")}
        if not both["LIGHT_IN_VERTEX"]:
            in_vertex.pop("TERMS")
        in_fragment = {**both, "FOG": self._fog, "DEFOCUS": self._defocus}
        if both["LIGHT_IN_VERTEX"]:
            in_fragment.pop("RECORD_ROW")
        program = self._player.programs.get(
            HERE / "billboard.vert", HERE / "billboard.frag", in_fragment, in_vertex
        )
        return self._player.vertex_array(program)

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        player = self._player
        view = reuse.camera(player.view, self._lens)
        fog = player.passes["fog"].uniforms(time) if self._fog else {}
        return view, reuse.frozen((player.lights, fog))

    def draw(self, time: float) -> None:
        """Draw all sprites at `time` seconds over the colour target."""
        if not len(self._set):
            return
        camera = self._player.view
        records, order = self._table(camera, self._player.lights)
        self._upload(records)
        target = self._frame.target("colour", "depth")
        target.depth_mask = False
        target.use()
        self._ctx.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
        self._ctx.depth_func = "<="
        self._ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._set_frame_uniforms(camera, time)
        self._records.use(1)
        # One draw for each run of neighbours in depth that share a texture
        sets = self._set[order]
        starts = np.flatnonzero(np.diff(sets, prepend=-1))
        counts = np.diff(starts, append=len(sets))
        for start, count in zip(starts.tolist(), counts.tolist(), strict=True):
            self._draw_run(int(sets[start]), start, count)
        target.depth_mask = True

    def _set_frame_uniforms(self, camera: Any, time: float) -> None:
        values = {**camera.uniforms(self._frame.size), "planes": 0, "records": 1}
        if self._lens:
            values |= self._player.passes["depth_of_field"].uniforms(camera)
        if self._fog:
            values |= self._player.passes["fog"].uniforms(time)
        if self._defocus:
            values |= {"front": 2, "front_depth": 3}
            self._frame.texture("near").use(2)
            self._frame.texture("near_depth").use(3)
        for program in {id(a.program): a.program for a in self._arrays}.values():
            set_uniforms(program, values)

    def _draw_run(self, number: int, start: int, count: int) -> None:
        sprites, array = self._sets[number], self._arrays[number]
        asset, program = sprites.asset, array.program
        sprites.texture.use(0)
        scale, offset = self._decoding[number]
        program["decode_scale"].write(scale)
        program["decode_offset"].write(offset)
        program["size"] = asset.size
        program["pivot"] = asset.pivot
        program["metres_per_texel"] = asset.metres_per_texel
        program["first"] = start
        if self._lens:
            program["lens_scale"] = asset.lens_scale
            program["max_lod"] = asset.max_lod
        self._frame.draw(array, mode=moderngl.TRIANGLE_STRIP, vertices=4, instances=count)

    # records

    def _table(self, camera: Any, lights: Any) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Return records (texels, 4): sorted instances, then light rows; and the order."""
        n = len(self._set)
        instances = np.zeros((n, 4, 4), np.float32)
        rows, at, first = [], 4 * n, 0
        depth = np.empty(n)
        shares = self._shares(lights)
        for number, sprites in enumerate(self._sets):
            span = slice(first, first := first + len(sprites.positions))
            light, index = self._lighting.project(
                lights,
                sprites.series,
                camera.yaw,
                sprites.centres,
                sprites.flip,
                [of_sun and of_sun[number] for of_sun in shares],
            )
            depth[span] = camera.depth(sprites.centres)
            _fill(instances[span], sprites, camera)
            instances[span, 2] = self._boxes(sprites, camera, depth[span])
            instances[span, 3, 1] = at + index * sprites.series.rows
            rows.append(light.reshape(-1, 3))
            at += len(rows[-1])
        order = np.argsort(-depth, kind="stable")
        table = np.zeros((at, 4), np.float32)
        table[: 4 * n] = instances[order].reshape(-1, 4)
        table[4 * n :, :3] = np.concatenate(rows)
        return table, order

    def _shares(self, lights: Any) -> list[list[NDArray[np.float64]] | None]:
        """Return for each sun the shares of it that reach the sprites of each set, None for all."""
        if not any(s.shadow for s in self._sets):
            return []
        brightest = max((float(sun.irradiance.max()) for sun in lights.suns), default=0.0)
        return [
            sprite_shadows.shares(self._sets, sun.to_light)
            if sun.irradiance.max() > FAINT * brightest
            else None
            for sun in lights.suns
        ]

    def _boxes(self, sprites: Any, camera: Any, depth: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, 4) boxes that hold all that shows at the level of each sprite."""
        size = sprites.asset.metres_per_texel * sprites.scale
        near = np.maximum(depth, 1e-3)
        texels_a_pixel = (
            camera.sensor_height * near / (camera.focal_length * self._frame.size[1] * size)
        )
        level = np.log2(np.maximum(texels_a_pixel, 1.0))
        if self._lens:
            # Blur is greatest at one end of the sprite's depth: it may lean from the camera
            reach = 2 * sprites.crown * sprites.scale + sprites.asset.height * sprites.scale
            lens = camera.focal_length, camera.f_number, camera.focus_distance
            ends = [np.maximum(depth + s * reach, 1e-3) for s in (-1, 0, 1)]
            blur = [
                optics.texels(optics.circle_of_confusion(d, *lens), d, lens[0], size) for d in ends
            ]
            asset = sprites.asset
            level = np.maximum(
                level, optics.lod(np.max(blur, axis=0), asset.lens_scale, asset.max_lod)
            )
        last = len(sprites.boxes) - 1
        # One level of reserve: seen from above there are more texels a pixel
        return sprites.boxes[np.minimum(np.ceil(level).astype(np.int64) + 1, last)]

    def _upload(self, records: NDArray[np.float32]) -> None:
        rows = -(-len(records) // RECORD_ROW)
        if self._records is None or self._records.height < rows:
            if self._records is not None:
                self._frame.drop(self._records)
            made = self._ctx.texture((RECORD_ROW, rows), 4, dtype="f4")
            made.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._records = self._frame.adopt(made, rows * RECORD_ROW * 16)
        padded = np.zeros((self._records.height * RECORD_ROW, 4), np.float32)
        padded[: len(records)] = records
        self._records.write(padded)


def _fill(instances: NDArray[np.float32], sprites: Any, camera: Any) -> None:
    towards = camera.position - sprites.positions
    view = sprites.view_from(np.arctan2(towards[:, 0], towards[:, 2]))
    instances[:, 0, :3] = sprites.positions
    instances[:, 0, 3] = sprites.scale
    instances[:, 1, :3] = sprites.tint
    instances[:, 1, 3] = np.where(sprites.flip, -1.0, 1.0)
    instances[:, 3, 0] = view * sprites.asset.planes
