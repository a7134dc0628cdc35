"""Meshes on the card: vertices, textures and materials of every mesh that stands in the scene."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from formats import mesh as meshes
from formats.errors import DamagedError, InputError
from formats.files import glb
from formats.meshes import KINDS, PlacedMesh
from runtime import reuse
from runtime.camera import column_major
from runtime.shader import set_uniforms

SRGB8_ALPHA8 = 0x8C43
ANISOTROPY = 8.0
GEOMETRY = {"position": (4, "f4"), "normal": (4, "f2"), "id": (1, "i4")}
"""Targets of what is nearest: components and type."""
PASSES = Path(__file__).parent / "passes"


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one material.

    vertices : buffer of rows of floats. columns : attribute -> floats, in order. index : buffer of
    32-bit numbers of vertices. custom : what a vertex array takes of the file's custom attributes.
    double_sided : light is known on both sides of its faces.
    """

    vertices: Any
    columns: dict[str, int]
    index: Any
    texture: Any
    base_color: tuple[float, float, float]
    emissive: tuple[float, float, float]
    custom: tuple[Any, ...] = ()
    double_sided: bool = False

    @property
    def defines(self) -> dict[str, bool]:
        """Flags of the shader that draws it."""
        return {"TEXTURED": self.texture is not None, "COLOURED": "tint" in self.columns}

    def content(self, program: Any) -> list[tuple[Any, ...]]:
        """Return what a vertex array of a program takes, stepping over what it does not use."""
        taken = [name for name in self.columns if name in program]
        layout = [f"{n}f" if name in taken else f"{4 * n}x" for name, n in self.columns.items()]
        return [(self.vertices, " ".join(layout), *taken)]


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh that stands in the scene. number : among its meshes, from 1. middle : (3,) of the box
    around it, in its own axes, metres of its file."""

    number: int
    placed: PlacedMesh
    parts: tuple[Part, ...]
    middle: NDArray[np.float64]


def load(player: Any, lighting: tuple[str, ...] = tuple(KINDS)) -> tuple[Surface, ...]:
    """Put the meshes of the player's scene on the card that are lit in one of these ways, what
    several share once.

    Raises DamagedError where a mesh is missing or its bytes changed.
    """
    folders = {way: player.folders(KINDS[way]) for way in lighting}
    shared: dict[Path, tuple[tuple[Part, ...], NDArray[np.float64]]] = {}
    surfaces = []
    for number, placed in enumerate(player.scene.meshes, start=1):
        if placed.lighting not in lighting:
            continue
        folder = folders[placed.lighting].get(placed.name)
        if folder is None:
            where = f"assets.{KINDS[placed.lighting]}/{placed.name}"
            raise DamagedError(player.folder / "manifest.json", where, "missing", "bake it again")
        if folder not in shared:
            textures: dict[bytes, Any] = {}
            parts = _primitives(placed.lighting, folder)
            made = tuple(_part(player, part, textures, folder) for part in parts)
            shared[folder] = made, _middle(parts)
        surfaces.append(Surface(number, placed, *shared[folder]))
    return tuple(surfaces)


def _middle(parts: list[glb.Primitive]) -> NDArray[np.float64]:
    """Middle (3,) of the box around all parts."""
    ends = [end(part.positions, axis=0) for part in parts for end in (np.min, np.max)]
    return np.asarray(0.5 * (np.min(ends, axis=0) + np.max(ends, axis=0)), np.float64)


def _primitives(lighting: str, folder: Path) -> tuple[glb.Primitive, ...]:
    if lighting == "direct":
        return meshes.primitives(folder)
    # Only scenes that call for transfer need its format
    from formats import transfer

    return transfer.primitives(folder)


def _part(player: Any, part: glb.Primitive, textures: dict[bytes, Any], folder: Path) -> Part:
    material, data = part.material, part.material.texture
    if part.normals is None:
        raise DamagedError(folder, "normals", "missing", "bake it again")
    columns = {"position": part.positions, "direction": part.normals}
    if data is not None and part.uv is not None:
        if data not in textures:
            # Only meshes with textures need Pillow
            from formats.files import image

            codes = image.decode(data, str(folder / meshes.NAME), space="stored")
            textures[data] = texture(player, codes, str(folder))
        columns["place"] = part.uv
    if part.colours is not None:
        columns["tint"] = part.colours
    rows = np.concatenate(list(columns.values()), axis=1).astype(np.float32)
    return Part(
        vertices=filled(player, rows),
        columns={name: values.shape[1] for name, values in columns.items()},
        index=filled(player, part.indices.astype(np.uint32)),
        texture=textures.get(data) if data is not None else None,
        base_color=material.base_color[:3],
        emissive=material.emissive,
        custom=_custom(player, part),
        double_sided=material.double_sided,
    )


def _custom(player: Any, part: glb.Primitive) -> tuple[Any, ...]:
    """Put custom attributes on the card, each of four numbers: codes from 0 to 1, half floats."""
    if not part.attributes:
        return ()
    names = sorted(part.attributes)
    stored = np.concatenate([part.attributes[name] for name in names], axis=1)
    layout = " ".join(["4f1" if stored.dtype == np.uint8 else "4f2"] * len(names))
    return (filled(player, stored), layout, *(name.lower().lstrip("_") for name in names))


def texture(player: Any, codes: NDArray[np.float32], name: str) -> Any:
    """Return a repeating, trilinear sRGB texture of a picture (h, w, 3 or 4), 0..1 as stored.

    Row 0 has v = 0. Raises InputError where this machine takes no picture so large.
    """
    ctx = player.ctx
    height, width = codes.shape[:2]
    limit = int(ctx.info["GL_MAX_TEXTURE_SIZE"])
    if max(width, height) > limit:
        remedy = f"this machine takes {limit} texels a side: use a smaller texture"
        raise InputError(name, "texture", f"{width}x{height}", remedy)
    texels = np.full((height, width, 4), 255, np.uint8)
    texels[..., :3] = np.rint(255 * codes[..., :3])
    made = ctx.texture((width, height), 4, texels, alignment=1, internal_format=SRGB8_ALPHA8)
    made.build_mipmaps()
    made.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    made.repeat_x = made.repeat_y = True
    if not player.targets.software and ctx.max_anisotropy > 1:
        made.anisotropy = min(ANISOTROPY, float(ctx.max_anisotropy))
    return player.targets.adopt(made, texels.nbytes * 4 // 3)


def filled(player: Any, values: NDArray[Any]) -> Any:
    """Return a buffer of these values that the player frees."""
    data = np.ascontiguousarray(values)
    made = player.buffer(data.nbytes)
    made.write(data)
    return made


class Geometry:
    """Draws the targets that later passes read, one sample a pixel.

    wanted : names of GEOMETRY. over : draws over what another pass left in them.
    """

    def __init__(
        self, player: Any, drawn: tuple[Surface, ...], wanted: tuple[str, ...], over: bool = False
    ) -> None:
        self._player, self._surfaces, self._over = player, drawn, over
        self._names = tuple((name, *GEOMETRY[name]) for name in wanted)
        places = {f"AT_{name.upper()}": i for i, name in enumerate(wanted)}
        flags = {name.upper(): name in wanted for name in GEOMETRY}
        program = player.programs.get(
            PASSES / "surface.vert",
            PASSES / "surface_geometry.frag",
            {**flags, **places},
            {"TEXTURED": False, "COLOURED": False},
        )
        self._arrays = [[self._array(program, part) for part in s.parts] for s in drawn]

    def _array(self, program: Any, part: Part) -> Any:
        return self._player.vertex_array(program, part.content(program), part.index)

    def draw(self, time: float) -> None:
        """Draw the nearest surface of each pixel at `time` seconds."""
        player = self._player
        target = player.targets.targets(self._names, "depth")
        target.use()
        if not self._over:
            target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
        player.ctx.enable_only(moderngl.DEPTH_TEST)
        player.ctx.depth_func = "<="
        for surface, arrays in zip(self._surfaces, self._arrays, strict=True):
            if not player.shows("mesh", surface.placed.name):
                continue
            place = {**place_uniforms(player, surface, time), "number": surface.number}
            for array in arrays:
                set_uniforms(array.program, place)
                player.targets.draw(array, mode=moderngl.TRIANGLES)


def wanted_geometry(player: Any) -> tuple[str, ...]:
    """Names of GEOMETRY that some pass of the player reads."""
    read = {name for drawn in player.passes.values() for name in drawn.reads}
    return tuple(name for name in GEOMETRY if name in read)


def key(player: Any, surfaces: tuple[Surface, ...], time: float) -> Hashable:
    """All that the drawing of meshes at `time` seconds depends on."""
    places = [surface.placed.world_from_mesh(time) for surface in surfaces]
    return reuse.camera(player.view), reuse.frozen((player.lights, places))


def draw_part(player: Any, part: Part, array: Any, place: dict[str, Any]) -> None:
    """Draw a part with what its material says and the uniforms of its place."""
    if part.texture is not None:
        part.texture.use(0)
    # Shadows take nothing of what is emitted: their pass adds it
    glow = (0.0, 0.0, 0.0) if "occlusion" in player.passes else part.emissive
    look = {"base_color": part.base_color, "emissive": glow, "albedo_texture": 0}
    set_uniforms(array.program, {**place, **look})
    player.targets.draw(array, mode=moderngl.TRIANGLES)


def place_uniforms(player: Any, surface: Surface, time: float) -> dict[str, Any]:
    """Matrices of a mesh at `time` seconds."""
    width, height = player.targets.size
    world_from_mesh = surface.placed.world_from_mesh(time)
    clip_from_world = player.view.clip_from_world(width / height)
    return {
        "clip_from_mesh": column_major(clip_from_world @ world_from_mesh),
        "world_from_mesh": column_major(world_from_mesh),
        # A rotation: the inverse transpose of a rotation and one scale is that rotation
        "world_from_normal": column_major(world_from_mesh[:3, :3] / surface.placed.scale),
    }
