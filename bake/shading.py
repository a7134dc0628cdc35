"""What a hit surface does with light: Lambert, light through thin sheets, and optional GGX gloss.

A hit has up to three *channels*, each one number a light times one colour a hit, so that the sum
over lights runs on numbers and colours enter once at the end:

    diffuse   max(0, n.l) V      albedo (1 - metallic * strength) (1 - tau) / pi
    through   max(0, -n.l) V'    albedo tau / pi              V' seen from the far side of the sheet
    gloss     D G F n.l V        strength * lerp(1, albedo, metallic)
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake.rays import Hits, RayScene, blend, offset_origins
from formats.mesh import Mesh

Float = NDArray[np.float32]


@dataclass(frozen=True)
class Shading:
    """Hits made ready for light, n of them; a miss has zero normals and so is never lit.

    front, back : (n, 3) ray origins on the viewer's and on the far side, unit space. normal : (n,
    3) shading normal towards the viewer. view : (n, 3) or (1, 3) unit direction to the viewer.
    diffuse, through, gloss : (n, 3) colours; through or gloss is None where no material has any.
    thin : (n,) light passes through. f0, alpha : (n,) Fresnel reflectance at normal incidence and
    GGX roughness squared.
    """

    front: Float
    back: Float | None
    normal: Float
    view: Float
    diffuse: Float
    through: Float | None
    gloss: Float | None
    thin: NDArray[np.bool_]
    f0: Float
    alpha: Float

    @property
    def colours(self) -> list[Float]:
        """The colours (n, 3) of the channels in use, in order."""
        return [c for c in (self.diffuse, self.through, self.gloss) if c is not None]

    def select(self, texels: NDArray[np.int64], samples: int) -> Shading:
        """Return the shading of some texels, where the hits are (samples, texels)."""

        def pick(values: NDArray[Any] | None) -> Any:
            if values is None or len(values) == 1 < len(self.normal):
                return values
            rest = values.shape[1:]
            return np.ascontiguousarray(values.reshape(samples, -1, *rest)[:, texels]).reshape(
                -1, *rest
            )

        return Shading(**{f.name: pick(getattr(self, f.name)) for f in fields(self)})


class Surface:
    """The materials of one mesh, ready to be asked at hits.

    transmission : share of light that thin (double-sided) faces let through, 0..1. gloss : strength
    of the GGX lobe, 0 (none, the default of baking) to 1.
    """

    def __init__(self, mesh: Mesh, scene: RayScene, transmission: float, gloss: float) -> None:
        self.mesh, self.scene, self.strength = mesh, scene, np.float32(gloss)
        self.geometric = scene.normals()
        # Where each corner's tangent plane lies along its normal
        self.planes = np.einsum("mij,mij->mi", mesh.normals, scene.corners)
        self.base = np.array([m.base_color for m in mesh.materials], np.float32).reshape(-1, 3)
        thin = np.array([m.double_sided for m in mesh.materials], bool)
        self.tau = np.where(thin, np.float32(transmission), np.float32(0))
        self.metallic = np.array([m.metallic for m in mesh.materials], np.float32)
        # Keep the lobe wide enough for a ring of 64 lights to see it
        self.alpha = np.array([max(m.roughness, 0.15) ** 2 for m in mesh.materials], np.float32)

    def at(self, hits: Hits, to_viewer: Float) -> Shading:
        """Return the shading at hits (n,), seen along `to_viewer` (n, 3) or (1, 3)."""
        missed = hits.face < 0
        hits = Hits(np.where(missed, 0, hits.face), hits.u, hits.v, hits.distance)
        geometric = self.geometric.take(hits.face, axis=0)
        towards = np.einsum("ij,ij->i", geometric, np.broadcast_to(to_viewer, geometric.shape))
        side = np.where(towards < 0, np.float32(-1), np.float32(1))
        geometric *= side[:, None]
        corners = self.mesh.normals.take(hits.face, axis=0)
        corners *= side[:, None, None]
        normal = _unit_or(blend(hits.weights, corners), geometric)
        normal[missed] = 0
        points = self.scene.points(hits)
        smooth = self._smooth_points(hits, points, corners, side)
        kind = self.mesh.material[hits.face]
        albedo, metallic, tau = (
            self.albedo(hits),
            self.metallic[kind][:, None],
            self.tau[kind][:, None],
        )
        albedo[missed] = 0
        through = albedo * tau / np.float32(np.pi) if self.tau.any() else None
        tint = 1 + metallic * (albedo - 1)
        return Shading(
            front=offset_origins(smooth, geometric),
            back=None if through is None else offset_origins(points, -geometric),
            normal=normal,
            view=to_viewer,
            # A metal without gloss would be black: it gives up only what its lobe takes
            diffuse=albedo * (1 - metallic * self.strength) * (1 - tau) / np.float32(np.pi),
            through=through,
            gloss=tint * self.strength if self.strength else None,
            thin=tau[:, 0] > 0,
            f0=0.04 + 0.96 * metallic[:, 0],
            alpha=self.alpha[kind],
        )

    def _smooth_points(self, hits: Hits, points: Float, corners: Float, side: Float) -> Float:
        """Lift points from their flat face to the smooth surface that its normals promise, so that
        the shadow's edge does not follow the facets (Hanika, *Hacking the Shadow Terminator*, Ray
        Tracing Gems II 2021, ch. 4). corners : (n, 3, 3) normals towards the viewer."""
        planes = self.planes.take(hits.face, axis=0) * side[:, None]
        depth = np.einsum("nij,nj->ni", corners, points) - planes
        return points - blend(hits.weights * np.minimum(depth, 0), corners)

    def albedo(self, hits: Hits) -> Float:
        """Return base colour times texture times vertex colour at hits, (n, 3) linear."""
        kind = self.mesh.material[hits.face]
        albedo = self.base[kind]
        corners = self.mesh.faces[hits.face]
        if self.mesh.colours is not None:
            albedo = albedo * blend(hits.weights, self.mesh.colours[corners])
        if self.mesh.uv is not None and any(m.texture is not None for m in self.mesh.materials):
            uv = blend(hits.weights, self.mesh.uv[corners])
            for i, material in enumerate(self.mesh.materials):
                chosen = np.flatnonzero(kind == i) if material.texture is not None else ()
                if len(chosen) and material.texture is not None:
                    albedo[chosen] = albedo[chosen] * bilinear(material.texture, uv[chosen])
        return np.asarray(albedo, np.float32)


def _unit_or(vectors: Float, geometric: Float) -> Float:
    """Return vectors (n, 3) at unit length; the geometric normal where they have none or point to
    the far side of it."""
    length = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    vectors /= np.maximum(length, np.float32(1e-12))[:, None]
    bad = (length <= 1e-12) | (np.einsum("ij,ij->i", vectors, geometric) <= 0)
    vectors[bad] = geometric[bad]
    return vectors


def bilinear(texture: Float, uv: Float) -> Float:
    """Sample a (h, w, 3) texture, row 0 on top, at uv (n, 2), (0, 0) bottom left, repeating."""
    height, width = texture.shape[:2]
    x = (uv[:, 0] % 1) * width - 0.5
    y = (1 - uv[:, 1] % 1) * height - 0.5
    x0, y0 = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = (x - x0)[:, None].astype(np.float32), (y - y0)[:, None].astype(np.float32)
    x1, y1 = (x0 + 1) % width, (y0 + 1) % height
    x0, y0 = x0 % width, y0 % height
    top = texture[y0, x0] * (1 - fx) + texture[y0, x1] * fx
    bottom = texture[y1, x0] * (1 - fx) + texture[y1, x1] * fx
    return np.asarray(top * (1 - fy) + bottom * fy)


def ggx(normal: Float, view: Float, light: Float, cosine: Float, alpha: Float, f0: Float) -> Float:
    """Return D G F n.l of the GGX lobe (n,), per unit irradiance (Walter et al. 2007, eq. 33, 34;
    height-correlated G of Heitz 2014, eq. 99; Fresnel of Schlick 1994).

    normal : (n, 3). view : (n, 3) or (1, 3). light : (3,). cosine : (n,) n.l > 0.
    """
    half = view + light
    half = half / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-9)
    nh = np.clip(np.einsum("ij,ij->i", normal, np.broadcast_to(half, normal.shape)), 0, 1)
    nv = np.clip(np.einsum("ij,ij->i", normal, np.broadcast_to(view, normal.shape)), 1e-4, 1)
    a2 = alpha * alpha
    d = a2 / (np.pi * np.square(nh * nh * (a2 - 1) + 1))
    g = 0.5 / (
        cosine * np.sqrt(nv * nv * (1 - a2) + a2) + nv * np.sqrt(cosine * cosine * (1 - a2) + a2)
    )
    f = f0 + (1 - f0) * (1 - np.clip(half @ light, 0, 1)) ** 5
    return np.asarray(d * g * f * cosine, np.float32)
