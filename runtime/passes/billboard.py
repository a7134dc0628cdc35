"""Sprites: sorted back to front, premultiplied, lit by their own light's harmonics or unlit.

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

from formats.scene import NEAR
from maths import discs, optics
from runtime import reuse
from runtime.shader import set_uniforms

HERE = Path(__file__).parent
RECORD_ROW = 1024  # texels of a row of the table of records
OF_SPRITE, OF_SET = 4, 3  # texels of a record
FAINT = 1 / 512  # of the brightest sun: its shadows would change less than half an 8-bit code
# Rows of light that fit in varyings. A dome's 15 would fill all that ES 3.00 has; on llvmpipe they
# made large sprites half as slow again as looking them up
IN_VERTEX = 9
MOST_LIT, LIT_CELLS = 4096, 12  # particles lit each for itself; cells along an axis for more
DISC = 5  # packing of what has no texture
OF_PIXEL = 1.0  # radius in pixels over which a disc is spread, so that none falls between pixels


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
        self._soft = any(s.softness > 0 for s in self._sets)
        self._made: dict[Any, Any] = {}
        self._arrays = [self._array(s.defines) for s in self._sets]
        self._decoding = [s.decoding() if s.series else None for s in self._sets]
        self._lighting = player.sprite_lighting
        self._records: Any = None
        self._lit = [s for s in self._sets if s.series is not None]
        self._standing = [s for s in self._lit if not s.moving]
        # Sets that share program and texture are one draw
        ids = [
            (id(array), s.texture.glo if s.texture else 0)
            for array, s in zip(self._arrays, self._sets, strict=True)
        ]
        self._drawn_as = np.array([ids.index(i) for i in ids], np.int64)

    def _array(self, defines: dict[str, int]) -> Any:
        both = {
            **defines,
            "LENS": self._lens,
            "DISC": defines["PACKING"] == DISC,
            "RECORD_ROW": RECORD_ROW,
            "LIGHT_IN_VERTEX": 0 < defines["TERMS"] <= IN_VERTEX,
        }
        in_vertex = {k: v for k, v in both.items() if k not in ("PLANES", "PACKING")}
        if not both["LIGHT_IN_VERTEX"]:
            in_vertex.pop("TERMS")
        in_fragment = {**both, "FOG": self._fog, "DEFOCUS": self._defocus, "SOFT": self._soft}
        if both["LIGHT_IN_VERTEX"] or not both["TERMS"]:
            in_fragment.pop("RECORD_ROW")
        program = self._player.programs.get(
            HERE / "billboard.vert", HERE / "billboard.frag", in_fragment, in_vertex
        )
        if program not in self._made:
            self._made[program] = self._player.vertex_array(program)
        return self._made[program]

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on."""
        player = self._player
        view = reuse.camera(player.view, self._lens)
        fog = player.passes["fog"].uniforms(time) if self._fog else {}
        moment = time if "particles" in player.passes else None
        return view, moment, reuse.frozen((player.lights if self._lit else None, fog))

    def draw(self, time: float) -> None:
        """Draw all sprites at `time` seconds over the colour target."""
        camera = self._player.view
        if "particles" in self._player.passes:
            self._player.passes["particles"].fill(time)
        records, sets = self._table(camera, self._player.lights)
        if not len(sets):
            return
        self._upload(records)
        # Soft edges read the depth, so that the shader tests it, not the target
        target = self._frame.target("colour", None if self._soft else "depth")
        target.depth_mask = False
        target.use()
        self._ctx.enable_only(moderngl.BLEND | (0 if self._soft else moderngl.DEPTH_TEST))
        self._ctx.depth_func = "<="
        self._ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._set_frame_uniforms(camera, time)
        self._records.use(1)
        # One draw for each run of neighbours in depth that share program and texture
        drawn = self._drawn_as[sets]
        starts = np.flatnonzero(np.diff(drawn, prepend=-1))
        counts = np.diff(starts, append=len(drawn))
        for start, count in zip(starts.tolist(), counts.tolist(), strict=True):
            self._draw_run(int(drawn[start]), start, count)
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
        if self._soft:
            values |= {"opaque_depth": 4}
            self._frame.texture("depth").use(4)
        for program in self._made:
            set_uniforms(program, values)

    def _draw_run(self, number: int, start: int, count: int) -> None:
        sprites, array = self._sets[number], self._arrays[number]
        program = array.program
        if sprites.texture:
            sprites.texture.use(0)
        decoding = self._decoding[number]
        if decoding is not None:
            program["decode_scale"].write(decoding[0])
            program["decode_offset"].write(decoding[1])
        program["first"] = start
        self._frame.draw(array, mode=moderngl.TRIANGLE_STRIP, vertices=4, instances=count)

    # records

    def _table(self, camera: Any, lights: Any) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Return records (texels, 4): sorted instances, sets, light rows; and whose each is."""
        found, depths, rows = [], [], []
        shares = self._shares(lights)
        for number, sprites in enumerate(self._sets):
            shown = len(sprites) and self._player.shows("billboard", sprites.name)
            if not shown:
                continue
            is_disc = sprites.texture is None
            spread = self._spread(sprites, camera) if is_disc else None
            seen = self._seen(sprites, camera, spread)
            if not len(seen):
                continue
            depth = camera.depth(sprites.centres[seen])
            instances = _instances(sprites, camera, seen)
            box = self._boxes(sprites, camera, depth, seen) if spread is None else spread[seen]
            instances[:, 2] = box
            instances[:, 3, 2] = number
            if sprites.series is not None:
                centres, flip, lit_as = _places(sprites, seen)
                light, index = self._lighting.project(
                    lights,
                    sprites.series,
                    camera.yaw,
                    centres,
                    flip,
                    [s[number][seen] if s and number in s else None for s in shares],
                )
                instances[:, 3, 1] = sum(map(len, rows)) + index[lit_as] * sprites.series.rows
                rows.append(light.reshape(-1, 3))
            found.append(instances)
            depths.append(depth)
        if not found:
            return np.empty((0, 4), np.float32), np.empty(0, np.int64)
        return self._sorted(np.concatenate(found), np.concatenate(depths), rows)

    def _sorted(
        self, instances: NDArray[np.float32], depth: NDArray[np.float64], rows: list[Any]
    ) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Lay sprites (n, 4, 4), farthest first, sets and light (m, 3) out as one table."""
        instances = instances[np.argsort(-depth, kind="stable")]
        sets = instances[:, 3, 2].astype(np.int64)
        of_sets = OF_SPRITE * len(instances)
        light = of_sets + OF_SET * len(self._sets)
        instances[:, 3, 1] += light
        instances[:, 3, 2] = of_sets + OF_SET * sets
        table = np.zeros((light + sum(map(len, rows)), 4), np.float32)
        table[:of_sets] = instances.reshape(-1, 4)
        table[of_sets:light] = np.concatenate([_of_set(s) for s in self._sets])
        if rows:
            table[light:, :3] = np.concatenate(rows)
        return table, sets

    def _shares(self, lights: Any) -> list[dict[int, NDArray[np.float64]] | None]:
        """Return for each sun the shares of it that reach the sprites of each set, None for all."""
        if not any(s.shadow for s in self._standing):
            return []
        from runtime import sprite_shadows

        numbers = [i for i, s in enumerate(self._sets) if s in self._standing]
        brightest = max((float(sun.irradiance.max()) for sun in lights.suns), default=0.0)
        return [
            dict(zip(numbers, sprite_shadows.shares(self._standing, sun.to_light), strict=True))
            if sun.irradiance.max() > FAINT * brightest
            else None
            for sun in lights.suns
        ]

    def _seen(self, sprites: Any, camera: Any, spread: Any) -> NDArray[np.int64]:
        """Return which sprites may show: a ball about the pivot holds all that is drawn."""
        asset, (x, y) = sprites.asset, sprites.pivot
        (w, h), texel = asset.size, asset.metres_per_texel
        reach = float(np.hypot(max(x, w - x), max(y, h - y))) * texel * sprites.scale
        if spread is not None:
            reach = spread[:, 0] + spread[:, 1]
        eye = (sprites.positions - camera.position) @ camera.view_from_world[:3, :3].T
        width, height = self._frame.size
        slope = 0.5 * camera.sensor_height / camera.focal_length
        seen = -eye[:, 2] + reach > NEAR
        for axis, side in ((0, slope * width / height), (1, slope)):
            outside = np.abs(eye[:, axis]) + side * eye[:, 2]
            seen &= outside <= reach * np.hypot(1.0, side)
        return np.flatnonzero(seen)

    def _spread(self, sprites: Any, camera: Any) -> NDArray[np.float64]:
        """Return (n, 4) radius, half width of the edge, gain of discs, and 0; metres."""
        depth = np.maximum(camera.depth(sprites.positions), NEAR)
        metres = depth / camera.focal_length  # of a metre of the sensor
        blur = OF_PIXEL * camera.sensor_height / self._frame.size[1] * metres
        if self._lens:
            lens = camera.focal_length, camera.f_number, camera.focus_distance
            blur = np.hypot(blur, 0.5 * optics.circle_of_confusion(depth, *lens) * metres)
        found = discs.blurred(0.5 * sprites.scale, sprites.asset.edge, blur)
        return np.stack([*found, np.zeros(len(depth))], axis=-1)

    def _boxes(
        self,
        sprites: Any,
        camera: Any,
        depth: NDArray[np.float64],
        seen: NDArray[np.int64],
    ) -> NDArray[np.float64]:
        """Return (n, 4) boxes that hold all that shows at the level of each sprite."""
        scale = sprites.scale[seen]
        size = sprites.asset.metres_per_texel * scale
        near = np.maximum(depth, 1e-3)
        texels_a_pixel = (
            camera.sensor_height * near / (camera.focal_length * self._frame.size[1] * size)
        )
        level = np.log2(np.maximum(texels_a_pixel, 1.0))
        if self._lens:
            # Blur is greatest at one end of the sprite's depth: it may lean from the camera
            reach = sprites.upright * (2 * sprites.crown + sprites.asset.height) * scale
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
        # One level of reserve where it stands: seen from above there are more texels a pixel
        level = level + 1.0 if sprites.upright else 1.0001 * level
        return sprites.boxes[np.minimum(np.ceil(level).astype(np.int64), last)]

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


def _places(sprites: Any, seen: NDArray[np.int64]) -> tuple[Any, Any, NDArray[np.int64]]:
    """Return where sprites are lit (m, 3), whether mirrored (m,), and by which of these each (n,).

    Many particles share the light of the middle of those in a cell of their box.
    """
    centres, flip = sprites.centres[seen], sprites.flip[seen]
    if not sprites.moving or len(seen) <= MOST_LIT:
        return centres, flip, np.arange(len(seen))
    low, high = centres.min(axis=0), centres.max(axis=0)
    share = (centres - low) / np.maximum(high - low, 1e-9)
    x, y, z = np.minimum(share * LIT_CELLS, LIT_CELLS - 1).astype(np.int64).T
    key = 2 * ((z * LIT_CELLS + y) * LIT_CELLS + x) + flip
    cells, lit_as, count = np.unique(key, return_inverse=True, return_counts=True)
    sums = [np.bincount(lit_as, weights=along) for along in centres.T]
    return np.stack(sums, axis=-1) / count[:, None], cells % 2 == 1, lit_as


def _instances(sprites: Any, camera: Any, seen: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return records (n, 4, 4) of the sprites that are seen, as billboard.vert has them."""
    made = np.zeros((len(seen), OF_SPRITE, 4), np.float32)
    positions = sprites.positions[seen]
    made[:, 0, :3] = positions
    made[:, 0, 3] = sprites.scale[seen]
    made[:, 1, :3] = sprites.tint[seen]
    opacity = np.broadcast_to(sprites.opacity, len(sprites))[seen]
    made[:, 1, 3] = np.where(sprites.flip[seen], -1.0, 1.0) * (1.0 + opacity)
    made[:, 3, 0] = sprites.layer
    if sprites.asset.views > 1:
        towards = camera.position - positions
        view = sprites.view_from(np.arctan2(towards[:, 0], towards[:, 2]), seen)
        made[:, 3, 0] += view * sprites.asset.planes
    made[:, 3, 3] = sprites.roll[seen]
    return made


def _of_set(sprites: Any) -> NDArray[np.float64]:
    """Return the record (3, 4) of a set."""
    asset = sprites.asset
    lens = asset.lens_scale, asset.max_lod
    return np.array([
        (*asset.size, *sprites.pivot),
        (asset.metres_per_texel, *lens, sprites.softness),
        (*sprites.share, len(asset.levels) - 1, sprites.upright),
    ])  # fmt: skip
