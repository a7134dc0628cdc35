"""What a mesh file says of its surface: colours and materials, from trimesh's to linear ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.mesh import BRIGHTEST, Material
from maths.colour import srgb_decode

Float = NDArray[np.float32]
RGB = tuple[float, float, float]


@dataclass(frozen=True)
class Look:
    """How one part looks. uv : (n, 2), colours : (n, 3) linear, a row a vertex, or None. notes :
    what was simplified."""

    uv: Float | None
    colours: Float | None
    material: Material
    notes: tuple[str, ...] = ()


@dataclass
class Reader:
    """Reads the looks of all parts of one file, each texture once.

    linear : vertex colours are linear, as in glTF; those of other formats are sRGB. strengths :
    factors on the emission of materials, by name (KHR_materials_emissive_strength).
    """

    linear: bool
    strengths: Mapping[str, float] = field(default_factory=dict)
    textures: dict[int, Float] = field(default_factory=dict)

    def look(self, mesh: Any, kept: NDArray[np.bool_]) -> Look:
        """Return how a trimesh geometry looks; kept : (m,) faces that count."""
        visual, count = mesh.visual, len(mesh.vertices)
        kind = getattr(visual, "kind", None)
        uv, material, raw = None, Material(), None
        if kind == "texture":
            raw = visual.vertex_attributes.get("color")
            uv = None if visual.uv is None else np.asarray(visual.uv, np.float32)
            if uv is not None and (uv.shape != (count, 2) or not np.isfinite(uv).all()):
                uv = None
            material = self._material(visual.material, has_uv=uv is not None)
        elif kind == "vertex":
            raw, material = visual.vertex_colors, Material(base_color=(1.0, 1.0, 1.0))
        elif kind == "face":
            shade = self._colours(np.asarray(visual.face_colors)[kept])
            if len(shade):
                material = Material(base_color=_rgb(shade.mean(axis=0)))
        colours = None if raw is None else self._colours(np.asarray(raw))
        if colours is not None and len(colours) != count:
            colours = None
        found = visual.material if kind == "texture" else None
        emissive, notes = self._emission(found, uv is not None)
        return Look(uv, colours, replace(material, emissive=emissive), notes)

    def _emission(self, material: Any, has_uv: bool) -> tuple[RGB, tuple[str, ...]]:
        """Return the radiance that a glTF material sends out; of a picture its mean counts."""
        factor = getattr(material, "emissiveFactor", None)
        if factor is None or not np.any(np.asarray(factor) > 0):
            return (0.0, 0.0, 0.0), ()
        strength = self.strengths.get(_name(material), 1.0)
        emitted = np.asarray(factor, np.float64) * strength
        notes: tuple[str, ...] = ()
        image = getattr(material, "emissiveTexture", None)
        if image is not None and has_uv:
            texture = self._texture(image)
            emitted = emitted * (0.0 if texture is None else texture.mean(axis=(0, 1)))
            notes = (f"{_name(material) or 'a material'} glows evenly, by its picture's mean",)
        red, green, blue = np.nan_to_num(emitted).clip(0, BRIGHTEST).tolist()
        return (red, green, blue), notes

    def _colours(self, raw: NDArray[Any]) -> Float:
        """Bring colours (n, 3 or 4) of any type to linear 0..1."""
        top = float(np.iinfo(raw.dtype).max) if raw.dtype.kind in "iu" else 1.0
        colours = np.nan_to_num(raw[:, :3].astype(np.float64) / top).clip(0, 1)
        return np.asarray(colours if self.linear else srgb_decode(colours), np.float32)

    def _material(self, material: Any, *, has_uv: bool) -> Material:
        if hasattr(material, "diffuse"):
            return self._plain_material(material, has_uv)
        factor = getattr(material, "baseColorFactor", None)
        image = getattr(material, "baseColorTexture", None) if has_uv else None
        return Material(
            name=_name(material),
            base_color=_rgb(np.ones(3) if factor is None else np.asarray(factor, np.float64) / 255),
            texture=self._texture(image),
            metallic=_share(getattr(material, "metallicFactor", None), 0.0),
            roughness=_share(getattr(material, "roughnessFactor", None), 0.7),
            double_sided=bool(getattr(material, "doubleSided", False)),
        )

    def _plain_material(self, material: Any, has_uv: bool) -> Material:
        """Read a material of OBJ or PLY, without the grey that trimesh makes up for what lacks."""
        from trimesh.visual.material import empty_material

        stated = material.kwargs.get("kd")
        image = material.image if has_uv else None
        if image is not None and stated is None:
            made_up = np.asarray(empty_material().image)
            image = None if np.array_equal(np.asarray(image), made_up) else image
        base = Material.base_color if image is None else (1.0, 1.0, 1.0)
        if isinstance(stated, list) and len(stated) == 3 and np.isfinite(stated).all():
            base = _rgb(np.asarray(stated, np.float64))
        # Blinn-Phong exponent to roughness, as trimesh's own to_pbr has it
        shine = material.glossiness
        known = isinstance(shine, float) and 0 <= shine < np.inf
        return Material(
            name=_name(material),
            base_color=base,
            texture=self._texture(image),
            roughness=float((2 / (shine + 2)) ** 0.25) if known else 0.7,
        )

    def _texture(self, image: Any) -> Float | None:
        """Return a picture of any mode as linear (h, w, 3), 0..1."""
        if image is None:
            return None
        # Parts of one file share their pictures, which live as long as its scene
        if id(image) not in self.textures:
            self.textures[id(image)] = _decoded(image)
        return self.textures[id(image)]


def _decoded(image: Any) -> Float:
    if image.mode.startswith("I"):
        # Sixteen bits of grey, which `convert` would cut off at 255
        grey = np.clip(np.asarray(image, np.float64) / 65535, 0, 1)
        return np.repeat(np.asarray(srgb_decode(grey), np.float32)[..., None], 3, axis=-1)
    table = np.asarray(srgb_decode(np.arange(256) / 255), np.float32)
    return np.asarray(table[np.asarray(image.convert("RGB"))])


def _rgb(base: NDArray[Any]) -> tuple[float, float, float]:
    red, green, blue = (float(value) for value in base[:3].clip(0, 1))
    return red, green, blue


def _name(material: Any) -> str:
    """Return a material's name, none where a file has something else in its place."""
    name = getattr(material, "name", None)
    return name if isinstance(name, str) else ""


def _share(value: Any, default: float) -> float:
    """Return a factor of 0..1, the default where the file states none."""
    return default if value is None or not np.isfinite(value) else float(np.clip(value, 0, 1))
