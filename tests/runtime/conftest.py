"""A headless context, and tiny real assets and scenes: spheres with closed-form coefficients."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from formats import seal
from formats.billboard import Billboard, Ring
from formats.environment import Environment
from formats.lightmap import Lightmap
from formats.mesh import Material, Mesh
from formats.occlusion import Occlusion
from formats.plan import FRAME
from formats.transfer import Transfer
from formats.voxels import Voxels
from maths import sprite_packing


@pytest.fixture(scope="session")
def context():
    """One headless context for the whole run."""
    from runtime.capture import make_context

    made = make_context()
    made.extra["nowhere"] = made.simple_framebuffer((1, 1))
    yield made
    made.release()


@pytest.fixture
def ctx(context):
    """The context, current, with OpenGL's error state checked before and after the test."""
    with context:
        # What the test before left bound is freed, and there is no default framebuffer
        context.extra["nowhere"].use()
        assert context.error == "GL_NO_ERROR"
        yield context
        assert context.error == "GL_NO_ERROR"


def lambert_terms(normals, albedo, ring):
    """Closed form of a Lambert surface under the ring: Y (K, h, w, 3), axis view.

    X(t) = albedo / pi max(0, A + B cos(t - t0)), A = n_z sin e, B = cos e |n_xy|.
    """
    e, h = ring.elevation, np.arange(ring.terms // 2 + 1)
    A, B = normals[..., 2] * np.sin(e), np.cos(e) * np.hypot(normals[..., 0], normals[..., 1])
    t0 = np.arctan2(normals[..., 1], normals[..., 0])
    B = np.maximum(B, 1e-9)
    u = np.arccos(np.clip(-A / B, -1, 1))
    series = [2 * (A * u + B * np.sin(u))]
    for k in h[1:]:
        shifted = u if k == 1 else np.sin((k - 1) * u) / (k - 1)
        series.append(
            2 * (A * np.sin(k * u) / k + B / 2 * (shifted + np.sin((k + 1) * u) / (k + 1)))
        )
    Y = [series[0] / np.sqrt(2 * np.pi)]
    for k in h[1:]:
        Y += [
            series[k] * np.sin(k * t0) / np.sqrt(np.pi),
            series[k] * np.cos(k * t0) / np.sqrt(np.pi),
        ]
    return np.stack(Y)[..., None] * albedo / np.pi


def halve(image):
    """Average 2x2 texels of (..., h, w, c) and clear the outer ones: premultiplied mips."""
    h, w = image.shape[-3] // 2, image.shape[-2] // 2
    small = image.reshape(*image.shape[:-3], h, 2, w, 2, image.shape[-1]).mean(axis=(-4, -2))
    if min(h, w) > 2:
        small[..., [0, -1], :, :] = 0
        small[..., :, [0, -1], :] = 0
    return small


def sphere_asset(
    *,
    terms=5,
    packing="twelve",
    unpack="chroma",
    size=64,
    views=1,
    half=False,
    colour=(0.8, 0.5, 0.3),
):
    """A matt ball one metre high on its pivot, with a pattern and a border of an eighth."""
    ring = Ring(axis="view", elevation=np.pi / 6, terms=terms, one_sided=True, lights=64)
    centre = (np.arange(size) + 0.5 - size / 2) / (3 / 8 * size)
    x, y = np.meshgrid(centre, -centre)
    inside = x**2 + y**2 < 1
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    normals = np.stack([x, y, z], axis=-1)
    checks = 0.7 + 0.3 * np.sign(np.sin(9 * x + 1) * np.sin(9 * y))
    planes = []
    for v in range(views):
        albedo = np.array(colour) * checks[..., None] * (1 if v == 0 else (v + 1) / (views + 1))
        Y = lambert_terms(normals, albedo, ring) * inside[..., None]
        planes.append(sprite_packing.pack(Y, inside.astype(float), packing))
    planes = np.array(planes)
    scales = sprite_packing.scales_of(np.moveaxis(planes, 0, 1))
    levels, level = [], planes
    while True:
        if half:
            unit = np.divide(
                level, scales[:, None, None], where=scales[:, None, None] > 0, out=level * 0
            )
            codes = unit.astype(np.float16)
        else:
            codes = np.stack([sprite_packing.encode(view, scales)[0] for view in level])
        levels.append(codes.reshape(-1, *codes.shape[2:]))
        if level.shape[2] == 1:
            break
        level = halve(level)
    return Billboard(
        levels=tuple(levels),
        scales=scales,
        packing=packing,
        unpack=unpack,
        ring=ring,
        views=views,
        metres_per_texel=1 / (0.75 * size),
        pivot=(size / 2, size * 7 / 8),
        height=1.0,
        max_lod=4.0,
        lens_scale=0.5,
    )


def scene_dict(**parts):
    """A scene of one ball at the origin under one sun; `parts` replace or add tables."""
    raw = {
        "format": 1,
        "camera": {"position": [0, 0.5, 4], "target": [0, 0.5, 0], "focal_length_mm": 50},
        "lights": [{"type": "sun", "to_light": list(SUN), "irradiance": list(IRRADIANCE)}],
        "billboards": [
            {"name": "ball", "source": "meshes/ball.glb", "height": 1.0, "positions": [[0, 0, 0]]}
        ],
        "picture": {"film": {"tonemap": "linear"}},
    }
    raw.update(parts)
    return {key: value for key, value in raw.items() if value is not None}


@pytest.fixture
def write_scene(tmp_path):
    """Return write(raw, assets, called) -> a sealed scene folder, as `bakelight bake` leaves it."""

    def write(raw, assets, *, called=None, environment=None, name="scene"):
        folder = tmp_path / name
        called = called_for(raw) if called is None else called
        (folder / "assets").mkdir(parents=True)
        where = {}
        for asset_name, asset in assets.items():
            place = folder / "assets" / asset_name
            place.mkdir()
            asset.save(place)
            seal.seal(place)
            kind = "mesh" if isinstance(asset, Mesh) else "billboard"
            kind = "transfer" if isinstance(asset, Transfer) else kind
            kind = "voxels" if isinstance(asset, Voxels) else kind
            if isinstance(asset, Lightmap):
                # Of the scene's one world: its faces alone where light is gathered
                kind = "faces" if "gather" in called else "lightmap"
                asset_name = "world"
            if isinstance(asset, Occlusion):
                # Of the mesh of that name: shadow-ball is of ball
                kind, asset_name = "occlusion", asset_name.removeprefix("shadow-")
            where[f"{kind}/{asset_name}"] = f"assets/{place.name}"
        if environment is not None:
            place = folder / "assets" / "environment0"
            place.mkdir()
            Environment(environment).save(place)
            seal.seal(place)
            index = [light["type"] for light in raw["lights"]].index("environment")
            where[f"environment/{index}"] = "assets/environment0"
        effects = [{"name": n, "called": n in called, "reason": ""} for n in FRAME]
        manifest = {
            "format": 1,
            "name": name,
            "scene": raw,
            "plan": {"effects": effects},
            "assets": where,
        }
        (folder / "manifest.json").write_text(json.dumps(manifest))
        seal.seal(folder)
        return Path(folder)

    return write


def called_for(raw):
    """What the plan would call for, by the tables alone."""
    picture = raw.get("picture", {})
    cubes, taking = raw.get("voxels"), raw.get("meshes") or raw.get("billboards")
    moves = cubes is not None and bool(cubes.get("lamps") or cubes.get("bodies"))
    wanted = {
        "lightmap": cubes is not None and not moves,
        "gather": moves,
        "probe": cubes is not None and bool(taking),
        "voxels": cubes is not None,
        "environment": any(light["type"] == "environment" for light in raw.get("lights", [])),
        "surface": any(m.get("lighting") != "transfer" for m in raw.get("meshes", [])),
        "transfer": any(m.get("lighting") == "transfer" for m in raw.get("meshes", [])),
        "ground": "ground" in raw,
        "sky": "sky" in picture,
        "occlusion": any("shadow" in mesh for mesh in raw.get("meshes", [])),
        "fog": "fog" in picture,
        "silhouette": any(m.get("silhouette_width", 0) > 0 for m in raw.get("meshes", [])),
        "defocus": bool(raw.get("meshes") or cubes) and "lens" in raw["camera"],
        "particles": bool(raw.get("particles")),
        "billboard": bool(raw.get("billboards") or raw.get("particles")),
        "depth_of_field": "lens" in raw["camera"],
        "radial_blur": "radial_blur" in picture,
        "bloom": "bloom" in picture,
        "film": True,
    }
    return tuple(name for name in FRAME if wanted[name])


SUN, IRRADIANCE = (0.5, 0.6, 0.7), (3.0, 3.0, 3.0)


def flat_mesh(corners, *materials, uv=None, colours=None, normals=None):
    """Triangles of corners (m, 3, 3), material i for triangle i, the last for the rest."""
    corners = np.asarray(corners, np.float64)
    materials = materials or (Material(),)
    m = len(corners)
    if normals is None:
        a, b, c = np.moveaxis(corners, 1, 0)
        across = np.cross(b - a, c - a)
        across /= np.linalg.norm(across, axis=-1, keepdims=True)
        normals = np.repeat(across[:, None], 3, axis=1)
    return Mesh(
        vertices=corners.reshape(-1, 3),
        faces=np.arange(3 * m).reshape(-1, 3),
        normals=np.asarray(normals, np.float32),
        material=np.minimum(np.arange(m), len(materials) - 1).astype(np.int32),
        materials=tuple(materials),
        uv=None if uv is None else np.asarray(uv, np.float32).reshape(-1, 2),
        colours=None if colours is None else np.asarray(colours, np.float32).reshape(-1, 3),
    )


def quad(*materials, half=1.0, **more):
    """A square of two triangles about the origin that faces +z."""
    a, b, c, d = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * half
    return flat_mesh([[a, b, c], [a, c, d]], *materials, **more)


def texel_to_pixel(asset, **parts):
    """A scene that shows the one ball with a pixel a texel, for pictures as large as the asset."""
    size = asset.size[0]
    # A pixel covers sensor / size of the sensor, distance / focal length times that beyond
    distance = asset.metres_per_texel * size * 50 / 24
    height = (asset.pivot[1] - size / 2) * asset.metres_per_texel
    camera = {
        "position": [0, height, distance],
        "target": [0, height, 0],
        "focal_length_mm": 50,
        "sensor_height_mm": 24,
    }
    return scene_dict(camera=camera, **parts)


@pytest.fixture
def kit():
    """The makers above, for tests in files that cannot import this one."""

    class Kit:
        SUN, IRRADIANCE = SUN, IRRADIANCE
        sphere_asset = staticmethod(sphere_asset)
        scene_dict = staticmethod(scene_dict)
        lambert_terms = staticmethod(lambert_terms)
        called_for = staticmethod(called_for)
        texel_to_pixel = staticmethod(texel_to_pixel)
        halve = staticmethod(halve)
        flat_mesh = staticmethod(flat_mesh)
        quad = staticmethod(quad)

    return Kit
