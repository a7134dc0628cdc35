"""Worlds of cubes whose light is known, and a maker of gathers for tests."""

from dataclasses import dataclass

import numpy as np

from bake import voxel_faces
from formats.voxels import Voxels
from maths.polygon_lights import rectangle_irradiance
from runtime.gather import Gather, Knobs
from runtime.shader import Programs
from runtime.voxel_world import VoxelVolume


@dataclass
class Glow:
    """A lamp's light among cells."""

    cells: np.ndarray
    share: np.ndarray
    radiance: np.ndarray


_PROGRAMS = {}


def makers(ctx):
    """Yield make(voxels, faces, knobs, ...) -> Gather; all are freed after the test.

    Programs stay for the next test.
    """
    made, programs = [], _PROGRAMS.setdefault(ctx, Programs(ctx))

    def make(voxels, faces, *, storage="rgba8", brightest=0.0, **more):
        own = {name: more.pop(name) for name in ("environment", "free", "lights") if name in more}
        gaps = more.get("mode") == "sphere"
        volume = VoxelVolume(ctx, voxels, storage=storage, gaps=gaps, brightest=brightest)
        found = Gather(ctx, programs, volume, faces, knobs=Knobs(**more), **own)
        made.append(found)
        return found

    yield make
    for each in made:
        each.release()
        each.volume.release()


def palette(*rows):
    """Albedo and emission of grey rows, row 0 empty."""
    table = np.array([(0.0, 0.0), *rows], np.float32)
    return [np.repeat(table[:, k : k + 1], 3, axis=1) for k in (0, 1)]


def box(n, albedo, emission=1.0):
    cells = np.ones((n, n, n), np.uint16)
    cells[1:-1, 1:-1, 1:-1] = 0
    return Voxels(cells, *palette((albedo, emission)))


def inside(faces, n):
    """Interior texels of the faces that look into a closed box of n cells."""
    at = np.nan_to_num(faces.positions(), nan=-1)
    return np.all((at > 0.9) & (at < n - 0.9), axis=-1)


def room():
    """Walls, a pillar, a lamp of three cells and a small coloured one."""
    cells = np.zeros((8, 7, 9), np.uint16)
    cells[:, 0], cells[0], cells[:, :, 0] = 1, 2, 3
    cells[3:5, 1:5, 4] = 1
    cells[2:5, 6, 2], cells[6, 1, 6] = 4, 5
    albedo = np.array([[0] * 3, [0.8] * 3, [0.6, 0.5, 0.4], [0.7, 0.2, 0.1], [0] * 3, [0.3] * 3])
    emission = np.zeros((6, 3))
    # Codes of a scale of 10: the volume stores them without error
    emission[4], emission[5] = np.array([[255, 204, 153], [51, 102, 204]]) * 10 / 255
    return Voxels(cells, albedo.astype(np.float32), emission.astype(np.float32))


def ceiling(texels):
    """A glowing rectangle in a dark ceiling: world, layout, floor texels, and their irradiance."""
    cells = np.zeros((11, 6, 11), np.uint16)
    cells[:, 0], cells[:, 5] = 1, 1
    cells[4:7, 5, 3:8] = 2
    place = {"cell_size": 0.5, "origin": (1.0, 2.0, -3.0)}
    voxels = Voxels(cells, *palette((0.0, 0.0), (0.0, 5.0)), **place)
    faces = voxel_faces.layout(cells, texels=texels, **place)
    at, up = faces.positions(), faces.normals()[..., 1] > 0
    floor = up & (np.abs(np.nan_to_num(at[..., 1]) - 2.5) < 1e-3)
    centre = np.array([1 + 0.5 * 5.5, 2 + 0.5 * 5, -3 + 0.5 * 5.5])
    halves = np.array([[0.5 * 2.5, 0.0, 0.0], [0.0, 0.0, 0.5 * 1.5]])
    y = np.array([0.0, 1.0, 0.0])
    light = rectangle_irradiance(at[floor].astype(float), y, centre, *halves, np.full(3, 5.0))
    return voxels, faces, floor, light


def apart(found, truth, used):
    """Relative RMSE over texels."""
    return np.sqrt(np.mean((found[used] - truth[used]) ** 2) / np.mean(truth[used] ** 2))


def lamp(x, y, z):
    cells = np.array([[x, y, z], [x + 1, y, z]])
    return [Glow(cells, np.array([0.4, 0.6]), np.array([10.0, 8.0, 6.0]))]
