"""What a scene says of a mesh's shadow."""

import pytest

from formats import scene
from formats.errors import InputError

CAMERA = {"position": [0, 1, 5], "target": [0, 0, 0]}


def read(shadow, **more):
    meshes = [{"name": "bust", "source": "meshes/bust.glb", "shadow": shadow}]
    raw = {"format": 1, "camera": CAMERA, "meshes": meshes, **more}
    return scene.from_dict(raw, where="small.toml", root=None).meshes[0].shadow


def test_a_mesh_without_the_table_casts_none():
    raw = {"format": 1, "camera": CAMERA, "meshes": [{"name": "a", "source": "a.glb"}]}
    assert scene.from_dict(raw, where="small.toml", root=None).meshes[0].shadow is None


def test_an_empty_table_is_the_sixteen_numbers_of_l_max_4():
    found = read({})
    assert (found.grid, found.l_max, found.components, found.harmonics) == (32, 4, 16, 25)
    assert (found.coloured, found.falloff, found.self) == (True, True, False)


def test_an_encoding_says_how_many_bytes():
    assert read({}).encoding == "talk"
    assert read({"grid": 16, "components": 18, "size": 99}).bytes == 16**3 * 20
    assert read({"encoding": "bands", "l_max": 7}).bytes == 512 << 10
    assert read({"encoding": "bands", "size": 128}).bytes == 128 << 10


@pytest.mark.parametrize(("quality", "rays"), [("draft", 128), ("balanced", 256), ("fine", 512)])
def test_quality_says_how_many_rays(quality, rays):
    assert read({}, quality=quality).rays == rays
    assert read({"rays": 99}, quality=quality).rays == 99


def test_quality_asks_for_bands_that_rays_and_grid_have_room_for():
    assert read({}, quality="reference").l_max == 8
    assert read({"rays": 50}, quality="reference").l_max == 6  # 49 harmonics
    assert read({"grid": 128}, quality="reference").l_max == 7
    assert read({"l_max": 3}, quality="reference").l_max == 3


@pytest.mark.parametrize(
    ("shadow", "field"),
    [
        ({"rays": 24, "l_max": 4}, "rays"),
        ({"grid": 128, "l_max": 8}, "grid"),
        ({"grid": 1}, "grid"),
        ({"components": 0}, "components"),
        ({"encoding": "zonal"}, "encoding"),
        ({"encoding": "bands", "size": 0}, "size"),
        ({"colored": True}, "colored"),
    ],
)
def test_what_cannot_be_baked_is_refused_by_name(shadow, field):
    with pytest.raises(InputError, match=rf"meshes\[0\].shadow.{field}"):
        read(shadow)
