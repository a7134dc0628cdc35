"""A mesh under a ring of lights becomes circular-harmonic coefficients, one set a texel.

Evans, *Making Pretty Pictures with D3D*, case 2: light the sprite from N directions on a circle and
project each texel and channel on a few Fourier terms, Y_k = integral X(t) B_k(t) dt. Self-shadowing
comes along, because X is traced.

Camera rays are cast once, not once a light; only hits that face a light cast a shadow ray; and the
projection streams over blocks of lights, so memory does not grow with their number. All subsamples
of one index share one direction a light, spread over the sun's disc from index to index: rays are
coherent, and Embree takes a single direction for a whole call.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import workers
from bake.gather import Gathered, Lights, gather, turns_of
from bake.rays import Hits, RayScene
from bake.shading import Shading, Surface
from bake.tiles import kept
from formats.billboard import Ring
from formats.coefficients import Coefficients
from formats.errors import InputError
from formats.mesh import Mesh
from maths import circular_harmonics
from maths.image_error import psnr
from maths.sampling import uniform_cone

Float = NDArray[np.float32]

TILE = 8192  # texels in work at once a thread: a few MiB of buffers, thousands of rays a call
GOLDEN = 0.6180339887498949


@dataclass(frozen=True)
class Params:
    """Knobs of a sprite. Angles in radians.

    resolution : texels along the object's longer side. views : 1..16 about the up axis. samples :
    rays a texel. axis, elevation, lights, terms : see formats.billboard.Ring. sun_diameter : angle
    that each light subtends. sky_fill : irradiance of an even sky, as a share of the light's, added
    to every direction. transmission : share of light let through by double-sided faces. gloss :
    strength of the materials' GGX lobe. field_of_view : of the object's height; 0 is orthographic.
    lights_per_sample : lights that each subsample casts shadow rays to, in turn; 0 chooses, see
    bake.gather. held_out : lights that an eighth of the texels is rendered under, for the report
    alone.
    """

    resolution: int = 512
    views: int = 1
    samples: int = 16
    axis: str = "view"
    elevation: float = float(np.pi / 6)
    lights: int = 64
    terms: int = 5
    sun_diameter: float = 0.00925
    sky_fill: float = 0.0
    transmission: float = 0.35
    gloss: float = 0.0
    field_of_view: float = 0.0
    lights_per_sample: int = 0
    held_out: int = 8

    def check(self) -> None:
        """Raise InputError for the first knob that is out of its range."""
        ranges: dict[str, tuple[float, float]] = {
            "resolution": (1, 8192), "views": (1, 16), "samples": (1, 4096), "lights": (1, 4096),
            "terms": (1, 33), "lights_per_sample": (0, 4096), "held_out": (0, 256),
            "elevation": (-1.5, 1.5), "sun_diameter": (0, 3.0), "sky_fill": (0, 100),
            "transmission": (0, 1), "gloss": (0, 1), "field_of_view": (0, 2.5),
        }  # fmt: skip
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError("billboard", name, value, f"choose from {low:g} to {high:g}")
            if isinstance(getattr(Params, name), int) and value != int(value):
                raise InputError("billboard", name, value, "choose a whole number")
        if self.terms % 2 == 0:
            raise InputError("billboard", "terms", self.terms, "terms must be odd: 1, 3, 5, ...")
        if self.axis not in ("view", "up"):
            raise InputError("billboard", "axis", self.axis, "choose view or up")


@dataclass(frozen=True)
class Frame:
    """Where the texels of a sprite lie.

    left, top : of the top-left corner, metres from the pivot, which is the foot of the up axis.
    width, height : texels. origin : the pivot in the mesh's space. reach : radius about it that
    holds the mesh. eye : (3,) from the pivot, sprite's frame; at infinite z for an orthographic
    view."""

    left: float
    top: float
    width: int
    height: int
    metres_per_texel: float
    origin: NDArray[np.float64]
    reach: float
    eye: tuple[float, float, float]
    object_height: float


def trace(
    mesh: Mesh, *, params: Params, progress: workers.Progress = workers.silent
) -> Coefficients:
    """Bake the coefficients of a mesh. InputError for knobs out of range and for a mesh without
    faces or with broken arrays."""
    params.check()
    if not len(mesh.faces):
        raise InputError("billboard", "mesh", "no faces", "use a mesh with triangles")
    mesh = mesh.checked("billboard: mesh")
    surface = Surface(mesh, RayScene(mesh.vertices, mesh.faces), params.transmission, params.gloss)
    frame, lights = frame_of(mesh, params), lights_of(params)
    texels = frame.width * frame.height
    spans = [
        (v, a, min(a + TILE, texels)) for v in range(params.views) for a in range(0, texels, TILE)
    ]
    done = kept(
        lambda span: _tile(surface, frame, lights, params, span), spans, progress, (Tile, Gathered)
    )
    return _assemble([tile for tile in done if tile is not None], mesh, frame, lights, params)


def frame_of(mesh: Mesh, params: Params) -> Frame:
    """Fit the sprite's frame about the mesh, the same for all views."""
    points = mesh.vertices[np.unique(mesh.faces)]
    low, high = points.min(axis=0), points.max(axis=0)
    # Stand on the mesh's own origin where that lies within it, else on the middle of its box
    inside = (low <= 0) & (high >= 0)
    foot = np.where(inside[[0, 2]].all(), 0.0, 1.0) * (low + high) / 2
    origin = np.array([foot[0], low[1], foot[2]])
    local = points - origin
    reach = float(np.sqrt(np.einsum("ij,ij->i", local, local).max())) or 1.0
    middle = local[:, 1].max() / 2
    distance = np.inf
    if params.field_of_view > 0:
        nearest = 1.05 * np.hypot(local[:, 0], local[:, 2]).max()
        distance = max(middle / np.tan(params.field_of_view / 2), nearest) or 1.0
    # Project the vertices on the plane of the up axis, from an eye at half the height
    corners = []
    for view in range(params.views):
        x, y, z = world_from_sprite(view, params.views).T @ local.T
        zoom = 1 / (1 - z / distance)
        seen = np.stack([x * zoom, middle + (y - middle) * zoom])
        corners += [seen.min(axis=1), seen.max(axis=1)]
    (left, bottom), (right, top) = np.min(corners, axis=0), np.max(corners, axis=0)
    texel = (max(right - left, top - bottom) or 1.0) / params.resolution
    width, height = (max(1, int(np.ceil(n / texel - 1e-9))) for n in (right - left, top - bottom))
    return Frame(
        # Centre what rounding up to whole texels adds
        left=float(left - (width * texel - (right - left)) / 2),
        top=float(bottom + height * texel),
        width=width,
        height=height,
        metres_per_texel=float(texel),
        origin=origin,
        reach=reach,
        eye=(0.0, float(middle), float(distance)),
        object_height=float(high[1] - low[1]) or float(texel),
    )


def world_from_sprite(view: int, views: int) -> NDArray[np.float64]:
    """Return the rotation (3, 3) of a view, whose camera stands at yaw 2 pi view / views (+y)."""
    yaw = 2 * np.pi * view / views
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def lights_of(params: Params) -> Lights:
    """Lay out the ring, the sky and the held-out lights that the knobs ask for."""
    angles = np.asarray(2 * np.pi * np.arange(params.lights) / params.lights, np.float64)
    fit = circular_harmonics.fit_weights(angles, params.terms)
    # Held-out lights sit at golden-ratio steps, at no simple fraction of the ring's own spacing
    held = np.asarray(2 * np.pi * ((np.arange(params.held_out) + 0.5) * GOLDEN % 1), np.float64)

    def about(azimuths: NDArray[np.float64]) -> NDArray[np.float64]:
        towards = circular_harmonics.ring_direction(azimuths, params.axis, params.elevation)
        return suns(towards, params.samples, params.sun_diameter)

    sky, share = sky_of(params.samples, params.sky_fill)
    return Lights(
        ring=about(angles),
        matrix=np.asarray(fit.matrix, np.float64),
        fit=fit,
        sky=sky,
        sky_share=share * float(np.sqrt(2 * np.pi)),
        held=about(held),
        held_angles=held,
        turns=turns_of(params.lights, params.samples, params.terms, params.lights_per_sample),
    )


def suns(towards: NDArray[np.float64], samples: int, diameter: float) -> NDArray[np.float64]:
    """Return directions (N, S, 3), those of each subsample spread over discs about (N, 3)."""
    disc = uniform_cone(_pattern(samples), diameter / 2)
    return np.array([_about(d, disc) for d in towards]).reshape(-1, samples, 3)


def sky_of(samples: int, fill: float) -> tuple[NDArray[np.float64], float]:
    """Return directions (Q, S, 3) of an even sky of irradiance `fill`, and what each adds."""
    count = -(-32 // samples) if fill > 0 else 0
    # Subsample s takes every S-th direction, so that each sees all of the sky
    sky = _sky(count * samples).reshape(count, samples, 3)
    return sky, fill * 2 / max(count, 1)


def _sky(count: int) -> NDArray[np.float64]:
    """Return directions (count, 3) spread by a sky of radiance (1 + y) / 2, on a golden spiral."""
    y = 2 * np.sqrt((np.arange(count) + 0.5) / count) - 1
    turn = 2 * np.pi * GOLDEN * np.arange(count)
    r = np.sqrt(1 - y * y)
    return np.asarray(np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=-1))


def _about(direction: NDArray[np.float64], cone: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn directions (S, 3) about +z to stand about `direction`."""
    helper = np.eye(3)[np.argmin(np.abs(direction))]
    x = np.cross(helper, direction)
    x /= np.linalg.norm(x)
    return np.asarray(cone @ np.array([x, np.cross(direction, x), direction]))


def _pattern(count: int) -> NDArray[np.float64]:
    """Return `count` points of the unit square (count, 2) by Roberts' R2 sequence, centred."""
    g = 1.32471795724474602596
    return np.asarray((0.5 + np.arange(count)[:, None] * np.array([1 / g, 1 / g**2])) % 1)


@dataclass(frozen=True)
class Tile:
    """What one tile of a view gave; texels, chosen : counted over the whole view, those that hit
    the mesh, and those that were also rendered under the held-out lights."""

    view: int
    texels: NDArray[np.int64]
    alpha: Float
    gathered: Gathered
    chosen: NDArray[np.int64]


def _tile(
    surface: Surface, frame: Frame, lights: Lights, params: Params, span: tuple[int, int, int]
) -> Tile | None:
    view, turn = span[0], world_from_sprite(span[0], params.views)
    seen = seen_texels(surface, frame, params, span)
    if seen is None:
        return None
    texels, alpha, shading = seen
    row, column = np.divmod(texels, frame.width)
    chosen = np.flatnonzero((column + 3 * row) % 8 == 0) if view == 0 else np.zeros(0, np.int64)
    gathered = gather(surface.scene, shading, lights, turn, params.samples, chosen)
    return Tile(view, texels, alpha, gathered, texels[chosen])


def seen_texels(
    surface: Surface, frame: Frame, params: Params, span: tuple[int, int, int]
) -> tuple[NDArray[np.int64], Float, Shading] | None:
    """Return texels (p,) that see the mesh, their coverage and the shading of all subsamples (S p,)
    of a span (view, first texel, end); None where there is none."""
    view, start, stop = span
    turn = world_from_sprite(view, params.views)
    hits, viewer = _camera_hits(surface.scene, frame, params, turn, start, stop)
    seen = np.flatnonzero((hits.face >= 0).any(axis=0))
    if not len(seen):
        return None
    alpha = (hits.face[:, seen] >= 0).mean(axis=0, dtype=np.float32)
    hits = Hits(*(getattr(hits, name)[:, seen].ravel() for name in ("face", "u", "v", "distance")))
    if len(viewer) > 1:
        viewer = viewer.reshape(params.samples, -1, 3)[:, seen].reshape(-1, 3)
    return start + seen, alpha, surface.at(hits, np.ascontiguousarray(viewer))


def _camera_hits(
    scene: RayScene, frame: Frame, params: Params, turn: NDArray[np.float64], start: int, stop: int
) -> tuple[Hits, Float]:
    """Cast the camera rays of texels start..stop; return hits as (S, p) arrays and directions to
    the viewer."""
    row, column = np.divmod(np.arange(start, stop), frame.width)
    jitter = _pattern(params.samples)[:, None, :]
    right, down = column + jitter[..., 0], row + jitter[..., 1]
    if np.isfinite(frame.eye[2]):
        x = frame.left + right * frame.metres_per_texel
        y = frame.top - down * frame.metres_per_texel
        to_eye = frame.eye - np.stack([x, y, np.zeros_like(x)], axis=-1)
        to_eye /= np.linalg.norm(to_eye, axis=-1, keepdims=True)
        viewer = np.ascontiguousarray(to_eye.reshape(-1, 3) @ turn.T, np.float32)
        # Start where the rays enter the mesh's reach: from a far eye, float32 would miss
        before = max(0.0, float(np.linalg.norm(frame.eye)) - 1.01 * frame.reach)
        world = (frame.eye - before * to_eye).reshape(-1, 3) @ turn.T + frame.origin
        origins = scene.to_unit(world)
    else:
        viewer = np.ascontiguousarray(turn[:, 2][None], np.float32)
        corner = turn @ np.array([frame.left, frame.top, frame.reach * 1.01]) + frame.origin
        corner, step = (corner - scene.centre) * scene.scale, frame.metres_per_texel * scene.scale
        origins = np.empty((right.size, 3), np.float32)
        for axis in range(3):
            along = corner[axis] + right * (turn[axis, 0] * step) - down * (turn[axis, 1] * step)
            origins[:, axis] = along.ravel()
    hits = scene.intersect(origins, -viewer, finite=True)
    return Hits(
        *(getattr(hits, n).reshape(params.samples, -1) for n in ("face", "u", "v", "distance"))
    ), viewer


def _assemble(
    tiles: list[Tile], mesh: Mesh, frame: Frame, lights: Lights, params: Params
) -> Coefficients:
    """Put the tiles together and say how good the fit is."""
    views, texels = params.views, frame.width * frame.height
    terms = np.zeros((views, params.terms, texels, 3), np.float32)
    alpha = np.zeros((views, texels), np.float32)
    for tile in tiles:
        terms[tile.view][:, tile.texels] = tile.gathered.terms
        alpha[tile.view, tile.texels] = tile.alpha
    chosen = np.concatenate([tile.chosen for tile in tiles] or [np.zeros(0, np.int64)])
    held = [tile.gathered.held for tile in tiles if len(tile.chosen)]
    one_sided = params.axis == "view" and params.elevation >= 0
    one = Coefficients(
        terms=terms.reshape(views, params.terms, frame.height, frame.width, 3),
        alpha=alpha.reshape(views, frame.height, frame.width),
        ring=Ring(params.axis, params.elevation, params.terms, one_sided, params.lights),
        metres_per_texel=frame.metres_per_texel,
        pivot=(-frame.left / frame.metres_per_texel, frame.top / frame.metres_per_texel),
        height=frame.object_height,
        held_out=np.concatenate([np.zeros((len(lights.held), 0, 3), np.float32), *held], axis=1),
        held_out_texels=chosen,
        held_out_angles=tuple(float(a) for a in lights.held_angles),
    )
    return replace(one, quality=quality_of(one, tiles, lights, mesh))


def quality_of(
    master: Coefficients, tiles: list[Tile], lights: Lights, mesh: Mesh
) -> dict[str, Any]:
    """Return held-out error, leave-one-out error, minimum and conditioning of the fit."""
    whole = [tile.alpha == 1 for tile in tiles]
    squares = np.concatenate(
        [t.gathered.squares[w] for t, w in zip(tiles, whole, strict=True)] or [np.zeros(0)]
    )
    kept = np.concatenate(
        [t.gathered.kept[w] for t, w in zip(tiles, whole, strict=True)] or [np.zeros(0)]
    )
    used = int(np.count_nonzero(np.abs(lights.matrix).sum(axis=1)))
    # Every hat value of even lights is used / N: leaving one out divides residuals by 1 - used / N
    square = float(np.mean(squares - kept, dtype=np.float64)) if squares.size else 0.0
    residual = float(np.sqrt(max(0.0, square)))
    spare = 1 - used / len(lights.ring)
    lowest, negative = _minimum(master)
    quality: dict[str, Any] = {
        "covered_texels": int(np.count_nonzero(master.alpha)),
        "terms_used": used,
        "condition": float(lights.fit.condition),
        "largest_gap_degrees": float(np.degrees(lights.fit.largest_gap)),
        "lights_per_sample": len(lights.ring) // lights.turns,
        "leave_one_out_rms": residual / spare if spare > 0 else None,
        "minimum": lowest,
        "negative_texels": negative,
        "mesh": {"faces": len(mesh.faces), "materials": len(mesh.materials)},
        "notes": [*mesh.notes, *lights.fit.warnings],
    }
    truth = master.held_out
    if truth.size:
        quality["held_out_peak"] = float(truth.max()) or 1.0
        quality["held_out_psnr"] = held_out_psnr(master, master.terms[0])
    return quality


def held_out_psnr(master: Coefficients, terms: Float) -> float:
    """Return how well terms (K, h, w, 3) of view 0 predict the held-out renders: dB, up to 200."""
    peak = float(master.held_out.max()) or 1.0
    return min(200.0, float(psnr(master.held_out, held_out_relit(master, terms), peak)))


def held_out_relit(master: Coefficients, terms: Float) -> Float:
    """Return terms (K, h, w, 3) of view 0 relit as the held-out renders (M, n, 3) were lit, clamped
    at 0."""
    basis = circular_harmonics.evaluate(np.asarray(master.held_out_angles), len(terms))
    Y = terms.reshape(len(terms), -1, 3)[:, master.held_out_texels]
    return np.asarray(np.maximum(np.einsum("kpc,mk->mpc", Y, basis.astype(np.float32)), 0))


def _minimum(master: Coefficients) -> tuple[float, float]:
    """Return the lowest relit radiance over 64 azimuths, and the share of texels that go below
    -.001 / pi."""
    lowest, below = 0.0, np.zeros(master.alpha.shape, bool)
    for basis in circular_harmonics.evaluate(2 * np.pi * np.arange(64) / 64, master.ring.terms):
        relit = np.einsum("vkhwc,k->vhwc", master.terms, basis.astype(np.float32))
        lowest = min(lowest, float(relit.min(initial=0.0)))
        below |= (relit < -1e-3 / np.pi).any(axis=-1)
    covered = int(np.count_nonzero(master.alpha))
    return lowest, int(np.count_nonzero(below)) / max(1, covered)
