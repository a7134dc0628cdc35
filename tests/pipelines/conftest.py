"""A tiny asset root: one mesh, one environment map, scenes that call for different effects."""

from pathlib import Path

import numpy as np
import pytest

from formats.files import glb, rgbe

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
}


@pytest.fixture
def assets(tmp_path: Path) -> Path:
    """An asset root with scenes/plain.toml, and one scene for each part alone, and all of them."""
    root = tmp_path / "assets"
    for folder in ("meshes", "environments", "scenes"):
        (root / folder).mkdir(parents=True)
    corners = np.array([[-0.5, 0, 0.5], [0.5, 0, 0.5], [0.5, 0, -0.5], [-0.5, 0, -0.5], [0, 1, 0]])
    faces = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    material = glb.Material("cloth", (0.8, 0.3, 0.2, 1.0))
    tent = glb.Primitive(corners.astype(np.float32), faces.astype(np.uint32), material=material)
    glb.write(root / "meshes/tent.glb", [glb.Node("tent", [tent])])
    rgbe.write(root / "environments/even.hdr", np.ones((4, 8, 3), np.float32))
    for name, chosen in {"plain": (), **{p: (p,) for p in PARTS}, "all": tuple(PARTS)}.items():
        text = SCENE.format(**{p: PARTS[p] if p in chosen else "" for p in PARTS})
        (root / "scenes" / f"{name}.toml").write_text(text)
    return root
