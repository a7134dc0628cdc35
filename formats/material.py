"""What a face of a mesh is made of."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formats.files import glb
from maths import colour

BRIGHTEST = 1e6
"""Largest emitted radiance, W/(m2 sr), as for the lights of a scene."""


@dataclass(frozen=True)
class Material:
    """What a face is made of (glTF 2.0 metallic-roughness).

    base_color : linear rgb, 0..1. texture : (h, w, 3) linear or None, row 0 on top, multiplies it.
    double_sided : a thin sheet, such as a leaf, through which a baker may let light pass.
    emissive : radiance that it sends out by itself, W/(m2 sr), linear rgb, from 0.
    """

    name: str = ""
    base_color: tuple[float, float, float] = (0.5, 0.5, 0.5)
    texture: NDArray[np.float32] | None = None
    metallic: float = 0.0
    roughness: float = 0.7
    double_sided: bool = False
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def fault(self) -> str:
        """Return what makes the material unusable, or nothing."""
        numbers = {"metallic": self.metallic, "roughness": self.roughness}
        numbers |= {f"base_color[{i}]": value for i, value in enumerate(self.base_color)}
        for name, value in numbers.items():
            if not 0 <= value <= 1:
                return f"{name} {value} is not from 0 to 1"
        for i, value in enumerate(self.emissive):
            if not 0 <= value <= BRIGHTEST:
                return f"emissive[{i}] {value} is not from 0 to {BRIGHTEST:g}"
        if self.texture is not None:
            texture = np.asarray(self.texture)
            if texture.dtype.kind != "f" or texture.ndim != 3 or texture.shape[2] != 3:
                return f"texture is {texture.dtype} {texture.shape}, not floats (h, w, 3)"
            if not texture.size or not np.all((texture >= 0) & (texture <= 1)):
                return "texture is empty, or not from 0 to 1"
        return ""

    @classmethod
    def of_glb(cls, stored: glb.Material, texture: NDArray[np.float32] | None) -> Material:
        """Return the material that a GLB holds, with its texture already decoded."""
        red, green, blue, _ = stored.base_color
        return cls(
            name=stored.name,
            base_color=(red, green, blue),
            texture=texture,
            metallic=stored.metallic,
            roughness=stored.roughness,
            double_sided=stored.double_sided,
            emissive=stored.emissive,
        )

    def as_glb(self, *, textured: bool) -> glb.Material:
        """Return what a GLB holds of it; its texture, where wanted, as an 8-bit sRGB PNG."""
        picture = self.texture if textured else None
        return glb.Material(
            name=self.name,
            base_color=(*self.base_color, 1.0),
            texture=None if picture is None else _png(picture),
            roughness=self.roughness,
            metallic=self.metallic,
            emissive=self.emissive,
            double_sided=self.double_sided,
        )


def _png(texture: NDArray[np.float32]) -> bytes:
    from PIL import Image

    from formats.files.image import PNG_LEVEL

    codes = np.ascontiguousarray(colour.quantise(colour.srgb_encode(texture)))
    buffer = io.BytesIO()
    Image.fromarray(codes).save(buffer, "PNG", compress_level=PNG_LEVEL)
    return buffer.getvalue()
