"""Scenes of a few shapes whose picture is known, written as files by a test."""

import numpy as np

from formats import scene
from formats.files import glb

GREY = 0.5
DOWN = {"position": [0.0, 4.0, 0.0], "target": [0.0, 0.0, 0.0], "focal_length_mm": 48.0}


def scene_of(root, camera=None, **tables):
    """Make a scene from tables as its file would have them; its sources lie in `root`."""
    raw = {"format": 1, "camera": camera or DOWN, **tables}
    return scene.from_dict(raw, where=root / "scenes" / "small.toml", root=root)


def write_mesh(folder, name, mesh, material=None):
    """Write a mesh as GLB with its own flat normals; returns its name as a source."""
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    part = glb.Primitive(
        corners.astype(np.float32),
        np.arange(len(corners), dtype=np.uint32).reshape(-1, 3),
        normals=mesh.normals.reshape(-1, 3).astype(np.float32),
        material=material or glb.Material(base_color=(1.0, 1.0, 1.0, 1.0)),
    )
    glb.write(folder / f"{name}.glb", [glb.Node(name, (part,))])
    return f"{name}.glb"


def ground_points(found_shape, camera=DOWN, cells=8):
    """Ground points (h, w, cells^2, 3) under each pixel of a camera that looks straight down, as
    `camera` has it with a sensor 24 mm high: its picture's top is -z."""
    height, width = found_shape
    offsets = (np.arange(cells) + 0.5) / cells
    y, x = np.meshgrid(offsets, offsets, indexing="ij")
    row = np.arange(height)[:, None, None] + y.ravel()
    column = np.arange(width)[None, :, None] + x.ravel()
    half = 0.5 * 24.0 / camera["focal_length_mm"] * camera["position"][1]
    right = (2 * column / width - 1) * half * width / height
    down = (2 * row / height - 1) * half
    points = np.zeros((*np.broadcast_shapes(row.shape, column.shape), 3))
    points[..., 0], points[..., 2] = right, down
    return points


def check_z(found, truth, worst=8.0):
    """Hold a picture (h, w, 3) against its truth by its own error bars.

    Batches are 16, so z is Student's t of 15 degrees: its square has mean 15/13 and variance
    1.154^2 (2 + 6/11) = 3.39. Only one channel counts: white light gives all three the same noise.
    """
    error = found.error[..., 0].astype(np.float64)
    assert np.all(error > 0)
    z = (found.radiance[..., 0] - truth) / error
    # Four standard deviations of the mean of z and of z squared
    assert abs(z.mean()) < 4 * np.sqrt(15 / 13 / z.size)
    assert abs((z * z).mean() - 15 / 13) < 4 * np.sqrt(3.39 / z.size)
    # One of a million is beyond 8
    assert np.abs(z).max() < worst
