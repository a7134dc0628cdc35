"""Meshes lit directly, in a world of cubes: closed forms in rooms that glow, and walls."""

import numpy as np
import pytest

from bake import voxel_faces
from formats.lightmap import Lightmap
from formats.material import Material
from formats.voxel_state import at_floor
from formats.voxels import Voxels
from runtime.player import Player

pytestmark = pytest.mark.gpu
GLOW, COLOUR = np.array([0.6, 1.0, 0.2]), np.array([0.8, 0.5, 0.25])


@pytest.fixture
def seen(ctx, write_scene, kit):
    """Return seen(cells, ...) -> radiance in the middle of a square that faces the camera."""

    def draw(cells, emission=GLOW, meshes=None, name="scene", **parts):
        table = np.float32([[0, 0, 0], emission])
        voxels = Voxels(np.asarray(cells, np.uint16), np.zeros((2, 3), np.float32), table, 0.5)
        placed = at_floor(voxels, (0.0, 0.0, 0.0))
        place = {"cell_size": placed.cell_size, "origin": placed.origin}
        faces = voxel_faces.layout(placed.cells, texels=1, **place)
        empty = np.zeros((faces.size[1], faces.size[0], 3), np.float32)
        raw = {
            "format": 1,
            "camera": {"position": [0, 1.5, 1.2], "target": [0, 1.5, 0]},
            "voxels": {"source": "a.vox", "cell_size": 0.5},
            "meshes": meshes or [{"name": "square", "source": "a.glb", "position": [0, 1.5, 0]}],
            "picture": {"film": {"tonemap": "linear"}},
            **parts,
        }
        square = kit.quad(Material(base_color=tuple(COLOUR)), half=0.3)
        assets = {"world": voxels, "light": Lightmap(empty, empty, faces), "square": square}
        folder = write_scene(raw, assets, name=name)
        with Player(folder, size=(16, 16), context=ctx) as player:
            assert "probe" in player.called
            return player.linear(0.0)[8, 8, :3]

    return draw


def room(n=6):
    cells = np.ones((n, n, n), int)
    cells[1:-1, 1:-1, 1:-1] = 0
    return cells


def test_a_room_that_glows_lights_as_an_even_sky(seen):
    # Half floats, and what places and rays miss of a polynomial: measured .4 %
    np.testing.assert_allclose(seen(room()), COLOUR * GLOW, rtol=0.01)


def test_walls_hide_lights(seen):
    sun = {"type": "sun", "to_light": [0, 0.5, 1], "irradiance": [3.0, 2.0, 1.0]}
    ball = {"type": "sphere", "position": [0, 1.5, 9], "radius": 0.5, "radiance": [30, 20, 10]}
    dark = seen(room(), np.zeros(3), lights=[sun, ball])
    assert not dark.any()
    cells = room()
    cells[-1] = 0
    lit = seen(cells, np.zeros(3), lights=[sun], name="open")
    cosine = 1 / np.sqrt(1.25)
    np.testing.assert_allclose(lit, COLOUR / np.pi * [3.0, 2.0, 1.0] * cosine, rtol=2e-3)
