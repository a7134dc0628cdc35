"""The lens on opaque things: a gather that keeps foreground and background apart.

Reads colour and depth; writes colour, depth, and the layers `near` (premultiplied) and `near_depth`
of what is blurred in front, which the sprites lay over themselves: what is nearer than focus, or
the edge of something beyond focus over what lies behind it. `depth` becomes that of what lies
behind that layer. What stands nearer than focus is a front layer with coverage; the
ground, which hides nothing that stands on it, belongs to the base. Circles of half a pixel or less
change nothing, and a sharp pixel takes no part in a blur.

References
----------
Potmesil, Chakravarty 1981, A Lens and Aperture Camera Model for Synthetic Image Generation.
Jimenez 2014, Next Generation Post Processing in Call of Duty: Advanced Warfare.
Abadie 2018, A Life of a Bokeh.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from maths import optics
from runtime import reuse
from runtime.shader import SCREEN, set_uniforms

HERE = Path(__file__).parent
LEVELS = 6  # of the pyramid of half-size layers
RINGS = 6  # texels of the widest radius on the level that is gathered
SIDE = 8  # texels of a tile
WIDEST = 0.25  # heights of the picture: no radius is larger
SPLIT = ("front", "blurred", "base", "radii")
SUMS = ("front_sum", "blurred_sum", "radius_sum", "before_sum")
FINISHED = (("colour", 4, "f2"), ("near", 4, "f2"), ("near_depth", 1, "f4"))


class Pass:
    """Blurs what is opaque."""

    reads = ("colour", "depth")
    writes = ("colour", "depth", "near", "near_depth")

    def __init__(self, player: Any) -> None:
        self._player = player
        flags = {"defocus_gather": {"RINGS": RINGS}, "defocus": {"LEVELS": LEVELS}}
        self._arrays = {
            name: player.vertex_array(
                player.programs.get(SCREEN, HERE / f"{name}.frag", flags.get(name, {}), {})
            )
            for name in (
                "defocus_split",
                "defocus_level",
                "defocus_tile",
                "defocus_gather",
                "defocus",
            )
        }

    def key(self, time: float) -> Hashable:
        """All that the drawing of `time` seconds depends on besides the opaque picture."""
        return reuse.camera(self._player.view, lens=True)

    def draw(self, time: float) -> None:
        """Blur the opaque picture of `time` seconds."""
        frame = self._player.targets
        width, height = frame.size
        # Whole tiles and whole texels of the coarsest level
        unit = max(1 << (LEVELS - 1), SIDE)
        half = tuple(unit * -(-side // (2 * unit)) for side in (width, height))
        tiles = tuple(side // SIDE for side in half)
        lens = self._lens()
        opaque = {"opaque_colour": "colour", "opaque_depth": "depth"}
        names = tuple(f"defocus_{name}" for name in SPLIT)
        self._run("defocus_split", frame.layers(names, half, levels=LEVELS), lens, opaque)
        for level in range(1, LEVELS):
            finer = {"finer": level - 1}
            self._run(
                "defocus_level",
                frame.coarser(names, level),
                finer,
                dict(zip(SPLIT, names, strict=True)),
            )

        # The widest circle that reaches each tile
        sources = {name: f"defocus_{name}" for name in SPLIT}
        spread = int(np.ceil(lens["widest"] / (2 * SIDE))) + 1
        own = frame.layers(("defocus_own",), tiles)
        reached = frame.layers(("defocus_tiles",), tiles)
        self._run("defocus_tile", own, {"spread": 0}, sources | {"tiles": "defocus_tiles"})
        self._run("defocus_tile", reached, {"spread": spread}, sources | {"tiles": "defocus_own"})

        sources["tiles"] = "defocus_tiles"
        sums = frame.layers(tuple(f"defocus_{name}" for name in SUMS), half)
        self._run("defocus_gather", sums, {"full_size": frame.size}, sources)
        sources |= {name: f"defocus_{name}" for name in SUMS}
        sources |= {"opaque_colour": "defocus_colour", "opaque_depth": "defocus_depth"}
        copied = frame.copied("defocus_colour", "defocus_depth")
        frame.ctx.copy_framebuffer(copied, frame.target("colour", "depth"))
        self._run("defocus", frame.targets(FINISHED, "depth"), lens, sources)

    def _run(self, name: str, target: Any, values: dict[str, Any], read: dict[str, str]) -> None:
        """Draw the screen with a program that reads targets by the names of its samplers."""
        frame, array = self._player.targets, self._arrays[name]
        units: dict[str, int] = {}
        for sampler, texture in read.items():
            if sampler in array.program:
                units[sampler] = len(units)
                frame.texture(texture).use(units[sampler])
        set_uniforms(array.program, {**values, **units, "side": SIDE})
        target.use()
        # Depth is written where there is some, whatever it was
        frame.ctx.enable_only(moderngl.DEPTH_TEST)
        frame.ctx.depth_func = "1"
        frame.draw(array, mode=moderngl.TRIANGLES, vertices=3)

    def _lens(self) -> dict[str, Any]:
        """Uniforms of the lens, and the ground as 1 - depth = plane . (x, y, 1) over pixels."""
        player = self._player
        view, (width, height) = player.view, player.targets.size
        named = view.uniforms(player.targets.size)
        lens = view.focal_length, view.f_number, view.focus_distance
        farthest = 0.5 * optics.pixels(
            optics.circle_of_confusion(np.inf, *lens), height, view.sensor_height
        )
        plane = np.array([0.0, 0.0, -1.0])
        if player.scene.ground is not None:
            rise = np.array(named["world_from_ray"]).reshape(3, 3)[:, 1]
            fall = player.scene.ground.height - view.position[1]
            if fall != 0.0:
                corner = rise[2] - rise[0] - rise[1]
                plane = np.array([2 * rise[0] / width, 2 * rise[1] / height, corner])
                plane *= named["near"] / fall
        return {
            "full_size": (width, height),
            "farthest": float(farthest),
            "widest": WIDEST * height,
            "focus_over_near": view.focus_distance / named["near"],
            "ground_plane": tuple(plane),
        }
