"""Meshes on the card: vertices, textures and materials of every mesh that stands in the scene."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from formats import mesh as meshes
from formats.errors import DamagedError, InputError
from formats.files import glb
from formats.meshes import PlacedMesh

SRGB8_ALPHA8 = 0x8C43
ANISOTROPY = 8.0


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one material.

    vertices : buffer of rows of floats. columns : attribute -> floats, in order. index : buffer of
    32-bit numbers of vertices.
    """

    vertices: Any
    columns: dict[str, int]
    index: Any
    texture: Any
    base_color: tuple[float, float, float]
    emissive: tuple[float, float, float]

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
    """A mesh that stands in the scene. number : among its meshes, from 1."""

    number: int
    placed: PlacedMesh
    parts: tuple[Part, ...]


def load(player: Any) -> tuple[Surface, ...]:
    """Put every mesh of the player's scene on the card, what several share once.

    Raises DamagedError where a mesh is missing or its bytes changed.
    """
    folders = player.folders("mesh")
    shared: dict[Path, tuple[Part, ...]] = {}
    surfaces = []
    for number, placed in enumerate(player.scene.meshes, start=1):
        folder = folders.get(placed.name)
        if folder is None:
            where = f"assets.mesh/{placed.name}"
            raise DamagedError(player.folder / "manifest.json", where, "missing", "bake it again")
        if folder not in shared:
            textures: dict[bytes, Any] = {}
            parts = meshes.primitives(folder)
            shared[folder] = tuple(_part(player, part, textures, folder) for part in parts)
        surfaces.append(Surface(number, placed, shared[folder]))
    return tuple(surfaces)


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
        vertices=_filled(player, rows),
        columns={name: values.shape[1] for name, values in columns.items()},
        index=_filled(player, part.indices.astype(np.uint32)),
        texture=textures.get(data) if data is not None else None,
        base_color=material.base_color[:3],
        emissive=material.emissive,
    )


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


def _filled(player: Any, values: NDArray[Any]) -> Any:
    data = np.ascontiguousarray(values)
    made = player.buffer(data.nbytes)
    made.write(data)
    return made
