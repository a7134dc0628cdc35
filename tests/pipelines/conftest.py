"""A tiny asset root: one mesh, one environment map, scenes that call for different effects."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from formats.files import glb, image, rgbe

SCENE = """
format = 1
quality = "draft"
time = {{ duration = 1.0, frame_rate = 4 }}
[camera]
position = [0, 1, 5]
target = [0, 0.5, 0]
{lens}
[[lights]]
type = "sun"
to_light = [0.5, 0.6, 0.7]
irradiance = [3, 3, 3]
{environment}
{surface}
[[billboards]]
name = "tent"
source = "meshes/tent.glb"
height = 1.0
resolution = 24
samples = 4
positions = [[0, 0, 0], [1, 0, -2], [-1, 0, 3]]
[picture]
sky = {{ zenith = [0.1, 0.2, 0.5], horizon = [0.6, 0.6, 0.6] }}
{fog}
"""
PARTS = {
    "lens": "lens = { f_number = 0.8, focus_distance = 5.0 }",
    "fog": "fog = { extinction = 0.05, radiance = [0.5, 0.5, 0.5] }",
    "environment": """[[lights]]
type = "environment"
source = "environments/even.hdr"
scale = 0.5""",
    "surface": """[[meshes]]
name = "house"
source = "meshes/tent.glb"
position = [2, 0, -1]""",
}
SPRITES_ONLY = tuple(part for part in PARTS if part != "surface")


def write_assets(root: Path) -> Path:
    """Write an asset root with scenes/plain.toml, a scene for each part, and all but meshes."""
    for folder in ("meshes", "environments", "scenes"):
        (root / folder).mkdir(parents=True)
    corners = np.array([[-0.5, 0, 0.5], [0.5, 0, 0.5], [0.5, 0, -0.5], [-0.5, 0, -0.5], [0, 1, 0]])
    faces = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    material = glb.Material("cloth", (0.8, 0.3, 0.2, 1.0))
    tent = glb.Primitive(corners.astype(np.float32), faces.astype(np.uint32), material=material)
    glb.write(root / "meshes/tent.glb", [glb.Node("tent", [tent])])
    rgbe.write(root / "environments/even.hdr", np.ones((4, 8, 3), np.float32))
    for name, chosen in {"plain": (), **{p: (p,) for p in PARTS}, "all": SPRITES_ONLY}.items():
        text = SCENE.format(**{p: PARTS[p] if p in chosen else "" for p in PARTS})
        (root / "scenes" / f"{name}.toml").write_text(text)
    return root


@pytest.fixture
def assets(tmp_path: Path) -> Path:
    """An asset root with scenes/plain.toml, and one scene for each part alone, and all of them."""
    return write_assets(tmp_path / "assets")


@pytest.fixture(scope="session")
def writing_assets() -> Callable[[Path], Path]:
    """Writes the root of `assets` into a folder of the caller's."""
    return write_assets


@pytest.fixture(scope="session")
def bowl() -> Callable[[Path], Path]:
    """Writes a matt bowl, each pixel a plane of its own lit by Lambert's law, as 20 photographs of
    12 x 12 and a `.lp` file into a folder; returns the path of the latter."""

    def written(folder: Path) -> Path:
        size, count = 12, 20
        folder.mkdir(parents=True)
        x = (np.arange(size) + 0.5) / size - 0.5
        normal = np.stack([*np.meshgrid(x, -x), np.ones((size, size))], axis=-1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        z = 0.3 + 0.7 * (np.arange(count) + 0.5) / count
        r, turn = np.sqrt(1 - z * z), 2.39996 * np.arange(count)
        lines = [f"{count}  "]
        for n, d in enumerate(np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1)):
            shade = np.maximum(normal @ d, 0)[..., None] * [0.8, 0.5, 0.3]
            image.write(folder / f"p{n}.png", shade)
            lines.append(f"C:\\set\\p{n}.png {d[0]} {d[1]} {d[2]}")
        (folder / "set.lp").write_bytes("\r\n".join(lines).encode())
        return folder / "set.lp"

    return written
