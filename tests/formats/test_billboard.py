"""Packed sprites on disk: what is written is what the player reads."""

from dataclasses import fields, replace

import numpy as np
import pytest

from formats import report, seal
from formats.billboard import Billboard, Ring
from formats.errors import DamagedError, InputError
from formats.files import ktx2


def make(rng, kind=np.uint8, views=2, planes=3, size=(16, 8)):
    levels = []
    for level in range(3):
        shape = (views * planes, size[0] >> level, size[1] >> level, 4)
        values = rng.integers(0, 256, shape) if kind is np.uint8 else rng.normal(size=shape)
        levels.append(values.astype(kind))
    return Billboard(
        levels=tuple(levels),
        scales=rng.uniform(0.1, 3, (planes, 4)).astype(np.float32),
        packing="twelve",
        unpack="chroma",
        ring=Ring("up", 0.4, 5, False, 48),
        views=views,
        metres_per_texel=0.1,
        pivot=(4.25, 15.0),
        height=1.5,
        max_lod=2.5,
        lens_scale=0.72,
        quality={"loss_bits_db": 0.05},
    )


@pytest.mark.parametrize("kind", [np.uint8, np.float16])
def test_files_keep_every_bit(kind, tmp_path, rng):
    board = make(rng, kind)
    board.save(tmp_path)
    found = Billboard.load(tmp_path)
    for field in fields(Billboard):
        if field.name != "levels":
            np.testing.assert_equal(getattr(found, field.name), getattr(board, field.name))
    assert len(found.levels) == 3
    for mine, theirs in zip(board.levels, found.levels, strict=True):
        assert theirs.dtype == kind
        np.testing.assert_array_equal(mine, theirs)
    assert found.scales.dtype == np.float32


def test_shape(rng):
    board = make(rng)
    assert board.planes == 3
    assert board.size == (8, 16)


def test_the_texture_is_one_that_others_can_read(tmp_path, rng):
    board = make(rng)
    board.save(tmp_path)
    texture = ktx2.read(tmp_path / "planes.ktx2")
    assert texture.kind == "array"
    np.testing.assert_array_equal(texture.levels[1], board.levels[1])


@pytest.mark.parametrize("name", ["planes.ktx2", "report.json"])
def test_damage_is_found(name, tmp_path, rng):
    make(rng).save(tmp_path)
    seal.seal(tmp_path)
    Billboard.load(tmp_path)
    data = bytearray((tmp_path / name).read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / name).write_bytes(data)
    with pytest.raises(DamagedError, match=name):
        Billboard.load(tmp_path)


def test_a_sealed_folder_serves_no_other_texture(tmp_path, rng):
    make(rng).save(tmp_path)
    (tmp_path / "planes.ktx2").rename(tmp_path / "old.ktx2")
    seal.seal(tmp_path)
    (tmp_path / "old.ktx2").rename(tmp_path / "planes.ktx2")
    with pytest.raises(DamagedError, match="not sealed"):
        Billboard.load(tmp_path)


def test_another_kind_is_refused(tmp_path, rng):
    make(rng).save(tmp_path)
    report.write(tmp_path, {**report.read(tmp_path), "kind": "environment"})
    with pytest.raises(DamagedError, match="environment"):
        Billboard.load(tmp_path)


def test_numbers_that_json_cannot_hold_are_refused(tmp_path, rng):
    board = replace(make(rng), quality={"psnr": float("inf")})
    with pytest.raises(InputError, match="psnr"):
        board.save(tmp_path)
