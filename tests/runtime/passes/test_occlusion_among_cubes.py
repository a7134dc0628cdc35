"""The shadow of a mesh on cubes that stand as near to it as its own box."""

import numpy as np
import pytest

from bake import voxel_faces
from formats.lightmap import Lightmap
from formats.material import Material
from formats.voxel_state import at_floor
from formats.voxels import Voxels
from runtime.player import Player
from tests.runtime.shadow_truth import ball_volume, small_box

pytestmark = pytest.mark.gpu
SIZE = (48, 32)
BOX = small_box((0.5, 0.8, 0.4), (0.0, 0.0, 0.0))


def test_cubes_in_the_box_of_a_caster_are_shaded(ctx, write_scene, kit):
    table = np.float32([[0, 0, 0], [0.5, 0.5, 0.5]])
    voxels = Voxels(np.ones((8, 1, 8), np.uint16), table, np.zeros((2, 3), np.float32), 0.5)
    placed = at_floor(voxels, (0.0, 0.0, 0.0))
    faces = voxel_faces.layout(
        placed.cells, texels=1, cell_size=placed.cell_size, origin=placed.origin
    )
    light = np.ones((faces.size[1], faces.size[0], 3), np.float32)
    # The floor lies 0.5 m under the caster's middle, in its box
    caster = {"name": "thing", "source": "a.glb", "position": [0, 1.0, 0], "scale": 1.0}
    sun = {"type": "sun", "to_light": [0, 1, 0], "irradiance": [1, 1, 1], "angular_diameter": 20}
    raw = {
        "format": 1,
        "camera": {"position": [0, 3.0, 1.5], "target": [0, 0.5, 0], "focal_length_mm": 35},
        "lights": [sun],
        "voxels": {"source": "a.vox", "cell_size": 0.5},
        "meshes": [{**caster, "shadow": {"l_max": 2, "components": 9}}],
        "picture": {"film": {"tonemap": "linear"}},
    }
    assets = {
        "world": voxels,
        "light": Lightmap(light, 0 * light, faces),
        "thing": kit.quad(Material("p", (0.8, 0.8, 0.8)), half=0.02),
        "shadow-thing": ball_volume(BOX, l_max=2),
    }
    called = kit.called_for(raw)
    assert "occlusion" in called
    pictures = []
    for off in ("", "occlusion"):
        names = tuple(name for name in called if name != off)
        folder = write_scene(raw, assets, called=names, name=f"without{off}")
        with Player(folder, size=SIZE, context=ctx) as player:
            pictures.append(player.linear(0.0)[..., 1])
            x, y = np.meshgrid(
                2 * (np.arange(SIZE[0]) + 0.5) / SIZE[0] - 1,
                1 - 2 * (np.arange(SIZE[1]) + 0.5) / SIZE[1],
            )
            camera = player.view
            ray = np.stack([x, y, np.ones_like(x)], -1) @ camera.world_from_ray(1.5).T
            at = camera.position + ray * ((0.5 - camera.position[1]) / ray[..., 1])[..., None]
    kept = pictures[0] / pictures[1]
    away = np.hypot(at[..., 0], at[..., 2])
    # Nothing would be 1 exactly. Bands up to 2 leave .45 right under the ball and .81 where the box
    # ends, as measured
    inside = np.all(np.abs(at - [0, 1.0, 0]) < BOX.half_extent, axis=-1) & (away > 0.1)
    assert inside.sum() > 20
    assert kept[inside & (away < 0.3)].max() < 0.7
    assert kept[inside].max() < 0.9
