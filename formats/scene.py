# ruff: noqa: RUF009 -- item() is dataclasses.field() with the schema as its metadata
"""A scene: what stands where, in which light, seen how, over time (the reference is docs/scene.md).

Metres, seconds; angles in degrees as in the file; +y up; radiance and albedo scene-linear Rec. 709.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from formats import lights, meshes, particles, plan, schema, voxel_world
from formats.errors import InputError
from formats.instances import Instances
from formats.keyed import Keyed
from formats.lights import (
    LIGHTS,
    RGB,
    Disc,
    EnvironmentLight,
    Light,
    Polygon,
    Rectangle,
    Sphere,
    Sun,
)
from formats.meshes import PlacedMesh
from formats.particles import Particles
from formats.scene_file import parse, root_of
from formats.schema import Where, item
from formats.sprites import QUALITIES, Billboards, Dome, Ring, check, check_source, complete
from formats.voxel_world import VoxelWorld
from maths import keyframes

__all__ = [
    "NEAR",
    "Billboards",
    "Bloom",
    "Camera",
    "Disc",
    "Dome",
    "EnvironmentLight",
    "Film",
    "Fog",
    "Ground",
    "Instances",
    "Keyed",
    "Lens",
    "Light",
    "Particles",
    "Picture",
    "PlacedMesh",
    "Polygon",
    "RadialBlur",
    "Rectangle",
    "Ring",
    "Scene",
    "Sky",
    "Sphere",
    "Sun",
    "Time",
    "VoxelWorld",
    "from_dict",
    "load",
]

FORMAT = 1
NEAR = 0.1  # metres in front of the camera; what is nearer is not drawn
ALBEDO = {"sizes": (3,), "low": 0.0, "high": 1.0}


@dataclass(frozen=True, kw_only=True)
class Time:
    """How long the animation is; a scene without it is a still."""

    duration: float = item("number", "length of the animation", 0.0, unit="s", low=0, high=86400)
    frame_rate: float = item("number", "frames a second", 24.0, unit="1/s", low=0.1, high=1000)


@dataclass(frozen=True, kw_only=True)
class Lens:
    """A thin lens; what is off its plane of focus blurs."""

    f_number: Keyed = item("keyed", "focal length over aperture", low=0.1, high=256)
    focus_distance: Keyed = item(
        "keyed", "from the camera to the plane of focus", unit="m", low=0.01, high=1e6
    )


@dataclass(frozen=True, kw_only=True)
class Camera:
    """A camera at `position` that looks at `target`, upright."""

    position: Keyed = item("keyed", "where the camera is", unit="m", sizes=(3,), low=-1e6, high=1e6)
    target: Keyed = item("keyed", "what it looks at", unit="m", sizes=(3,), low=-1e6, high=1e6)
    focal_length_mm: Keyed = item("keyed", "focal length", 50.0, unit="mm", low=1, high=2000)
    sensor_height_mm: float = item(
        "number", "height of the sensor", 24.0, unit="mm", low=1, high=500
    )
    lens: Lens | None = item("table", "calls for depth of field", None, table=Lens)


@dataclass(frozen=True, kw_only=True)
class Ground:
    """A level plane, mottled by noise between two albedos."""

    height: float = item("number", "y of the plane", 0.0, unit="m", low=-1e6, high=1e6)
    albedo: tuple[float, float, float] = item("vector", "main albedo", [0.18, 0.18, 0.18], **ALBEDO)
    accent: tuple[float, float, float] = item(
        "vector", "the other albedo of the mottling; absent: as albedo", None, **ALBEDO
    )
    scale: float = item("number", "size of the mottling", 1.0, unit="m", low=1e-3, high=1e4)

    def __post_init__(self) -> None:
        if self.accent is None:
            object.__setattr__(self, "accent", self.albedo)


@dataclass(frozen=True, kw_only=True)
class Sky:
    """A gradient behind everything."""

    zenith: Keyed = item("keyed", "radiance overhead", **RGB)
    horizon: Keyed = item("keyed", "radiance at the horizon", **RGB)
    glow: Keyed | None = item("keyed", "radiance added around the first sun", None, **RGB)


@dataclass(frozen=True, kw_only=True)
class Fog:
    """Mist, which may thin with height: extinction * exp(-falloff * y)."""

    extinction: Keyed = item("keyed", "at y = 0", unit="1/m", low=0, high=1e3)
    radiance: Keyed = item("keyed", "of thick fog", **RGB)
    falloff: float = item("number", "thinning with height", 0.0, unit="1/m", low=0, high=1e3)


@dataclass(frozen=True, kw_only=True)
class Film:
    """From radiance to the picture."""

    exposure: Keyed = item(
        "keyed", "factor 2^exposure on radiance", 0.0, unit="EV", low=-32, high=32
    )
    tonemap: Literal["linear", "filmic"] = item(
        "text", "curve from radiance to display light", "filmic", choices=("linear", "filmic")
    )
    vignette: float = item("number", "darkening of the corners", 0.0, low=0, high=1)
    grain: float = item(
        "number",
        "standard deviation of noise on mid grey, less on dark and bright",
        0.0,
        unit="codes",
        low=0,
        high=16,
    )


@dataclass(frozen=True, kw_only=True)
class Bloom:
    """Light that scatters around what is bright; none is added, none is lost."""

    strength: Keyed = item("keyed", "share of the light that scatters", 0.1, low=0, high=1)
    threshold: float = item(
        "number",
        "only light beyond it scatters; at 0 all does",
        0.0,
        unit=lights.RADIANCE,
        low=0,
        high=1e4,
    )
    radius: float = item(
        "number",
        "standard deviation of the widest octave, share of the picture's height",
        0.1,
        low=1e-3,
        high=0.5,
    )


@dataclass(frozen=True, kw_only=True)
class RadialBlur:
    """Streaks towards a point, as of a lens that zooms while the shutter is open."""

    strength: Keyed = item(
        "keyed", "length of a streak, share of the way to the centre", 0.1, low=0, high=1
    )
    centre: tuple[float, float] = item(
        "vector",
        "where streaks lead, shares of width and height from the top left",
        [0.5, 0.5],
        sizes=(2,),
        low=0,
        high=1,
    )
    samples: int = item("integer", "of a streak, at most one a pixel", 16, low=2, high=128)


@dataclass(frozen=True, kw_only=True)
class Picture:
    """What finishes the picture; an absent line is an effect not called for."""

    sky: Sky | None = item("table", "calls for the sky", None, table=Sky)
    fog: Fog | None = item("table", "calls for fog", None, table=Fog)
    radial_blur: RadialBlur | None = item("table", "calls for streaks", None, table=RadialBlur)
    bloom: Bloom | None = item("table", "calls for bloom", None, table=Bloom)
    film: Film = item("table", "exposure, tonemap and grain", {}, table=Film)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A whole scene.

    name : of the scene and its folder. raw : the file's own content, fit for JSON.
    file : where it was read. sources : files it names, as written -> absolute (without a root as
    written).
    """

    name: str
    raw: dict[str, Any]
    file: str
    sources: Mapping[str, Path]
    root: Path | None = None
    format: int = item("integer", "of this file", low=1, high=FORMAT)
    time: Time = item("table", "length and frame rate", {}, table=Time)
    quality: Literal["draft", "balanced", "fine", "reference"] = item(
        "text",
        "sets what sprites, shadows, transfer and cubes leave open",
        "balanced",
        choices=QUALITIES,
    )
    camera: Camera = item("table", "the camera", table=Camera)
    lights: tuple[Light, ...] = item("tables", "lights", [], tables=LIGHTS)
    ground: Ground | None = item("table", "calls for the ground", None, table=Ground)
    meshes: tuple[PlacedMesh, ...] = item("tables", "opaque meshes", [], tables={"": PlacedMesh})
    voxels: VoxelWorld | None = item("table", "calls for a world of cubes", None, table=VoxelWorld)
    billboards: tuple[Billboards, ...] = item("tables", "sprites", [], tables={"": Billboards})
    particles: tuple[Particles, ...] = item(
        "tables", "small things in the air", [], tables={"": Particles}
    )
    picture: Picture = item("table", "sky, fog and film", {}, table=Picture)
    force: dict[str, bool] = item(
        "switches",
        "effect = true or false, over what the plan found; lights = true keeps every light",
        {},
        choices=(*plan.FRAME, "lights"),
    )


def load(path: str | Path, root: str | Path | None = None) -> Scene:
    """A scene from a .toml or .json file.

    root : where source paths start; the folder that holds scenes/ when None.
    Raises InputError naming file, field, value and remedy.
    """
    file = Path(path)
    raw = parse(file)
    return from_dict(raw, where=file, root=_root(file, root))


def from_dict(
    raw: dict[str, Any], *, where: str | Path, root: str | Path | None, name: str | None = None
) -> Scene:
    """A scene from a raw table.

    where : the file that errors name. root : where source paths start; None looks up no source, for
    a baked scene that carries its assets. name : the stem of `where` when None.
    Raises InputError naming file, field, value and remedy.
    """
    name = Path(where).stem if name is None else name
    if not schema.NAME.fullmatch(name):
        remedy = "rename it to at most 64 letters, digits, - and _: it names the baked folder"
        raise InputError(where, "", name, remedy)
    place = Where(str(where), root=None if root is None else Path(root))
    found = schema.read_fields(Scene, raw, place)
    for i, group in enumerate(found.get("billboards", ())):
        check_source(group, place.at("billboards").item(i))
    quality = QUALITIES.index(found.get("quality", "balanced"))
    found["billboards"] = tuple(complete(b, quality) for b in found.get("billboards", ()))
    found["meshes"] = tuple(meshes.complete(m, quality) for m in found.get("meshes", ()))
    if found.get("voxels") is not None:
        found["voxels"] = schema.completed(found["voxels"], quality)
    scene = Scene(
        name=name,
        raw=copy.deepcopy(raw),
        file=str(where),
        sources=place.sources,
        root=place.root,
        **found,
    )
    _check(scene, place)
    return scene


def _root(file: Path, root: str | Path | None) -> Path:
    if root is not None:
        if not Path(root).is_dir():
            raise InputError(root, "root", str(root), "name a folder")
        return Path(root)
    if found := root_of(file):
        return found
    remedy = (
        "put the scene into a folder named scenes, or name the folder of its sources with --root"
    )
    raise InputError(file, "", "not in a folder named scenes", remedy)


def _check(scene: Scene, where: Where) -> None:
    """Refuse what only several fields together show to be wrong."""
    camera = scene.camera
    met = _meeting(camera)
    if met is not None:
        where.at("camera").at("target").refuse(
            f"the camera's own position near {met:.3g} s", "look at another point"
        )
    if camera.lens and camera.lens.focus_distance.extremes[0] <= (
        longest := camera.focal_length_mm.extremes[1] / 1000
    ):
        where.at("camera").at("lens").at("focus_distance").refuse(
            camera.lens.focus_distance.extremes[0], f"focus beyond the focal length, {longest:g} m"
        )
    for i, light in enumerate(scene.lights):
        lights.check(light, where.at("lights").item(i))
    for i, mesh in enumerate(scene.meshes):
        place = where.at("meshes").item(i).at("name")
        if not schema.NAME.fullmatch(mesh.name):
            place.refuse(mesh.name, "write at most 64 letters, digits, - and _")
        if mesh.name in [other.name for other in scene.meshes[:i]]:
            place.refuse(mesh.name, "give each mesh another name")
        meshes.check(mesh, where.at("meshes").item(i))
    if scene.voxels is not None:
        voxel_world.check(scene.voxels, where.at("voxels"))
    used = {each.look.billboard for each in scene.particles}
    for i, found in enumerate(scene.particles):
        place = where.at("particles").item(i)
        if found.name in [other.name for other in scene.particles[:i]]:
            place.at("name").refuse(found.name, "give each another name")
        particles.check(found, scene.billboards, place)
    names = [billboards.name for billboards in scene.billboards]
    for i, billboards in enumerate(scene.billboards):
        place = where.at("billboards").item(i)
        if billboards.name in names[:i]:
            place.at("name").refuse(billboards.name, "give each set another name")
        check(billboards, place, used=billboards.name in used)


def _meeting(camera: Camera) -> float | None:
    """A moment at which the camera passes through its target, None where it never does."""
    times = np.union1d(camera.position.times, camera.target.times)
    # Between two keys nothing jumps: join 64 moments of each gap, and its last, by straight lines
    gaps = np.diff(times, append=times[-1] + 1.0)[:, None]
    moments = times[:, None] + gaps * np.append(np.arange(64) / 64, 1 - 1e-9)
    towards = _sampled(camera.target, moments) - _sampled(camera.position, moments)
    start, step = towards[:, :-1], np.diff(towards, axis=1)
    along = -(start * step).sum(axis=-1) / np.maximum((step * step).sum(axis=-1), 1e-30)
    nearest = start + np.clip(along, 0, 1)[..., None] * step
    close = np.linalg.norm(nearest, axis=-1) < 1e-6
    return float(moments[:, :-1][close][0]) if close.any() else None


def _sampled(keys: Keyed, moments: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(
        keyframes.sample(keys.times, keys.values, moments, keys.interpolation, keys.loop)
    )
