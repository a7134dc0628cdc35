"""The float master: bit-exact files, damage found, arrays checked."""

from dataclasses import fields, replace

import numpy as np
import pytest

from formats import report, seal
from formats.billboard import Ring
from formats.coefficients import LARGEST, Coefficients
from formats.errors import DamagedError, InputError


def make(rng, views=2, terms=5, size=(6, 7), held=(3, 11), ring=None):
    texels = size[0] * size[1]
    return Coefficients(
        terms=rng.normal(size=(views, terms, *size, 3)).astype(np.float32),
        alpha=rng.uniform(0, 1, (views, *size)).astype(np.float32),
        ring=ring or Ring("up", 0.7, terms, False, 32),
        metres_per_texel=0.0625,
        pivot=(3.5, 6.0),
        height=0.375,
        held_out=rng.uniform(0, 1, (*held, 3)).astype(np.float32),
        held_out_texels=rng.permutation(texels)[: held[1]].astype(np.int64),
        held_out_angles=tuple(float(a) for a in rng.uniform(0, 6, held[0])),
        quality={"held_out_psnr": 31.5, "notes": []},
    )


@pytest.mark.parametrize("views", [1, 3])
@pytest.mark.parametrize("terms", [1, 5, 9])
@pytest.mark.parametrize("held", [(3, 11), (2, 1), (2, 0), (0, 0), (0, 5), (1, 42)])
def test_files_keep_every_bit(views, terms, held, tmp_path, rng):
    master = make(rng, views, terms, held=held)
    master.save(tmp_path)
    found = Coefficients.load(tmp_path)
    for field in fields(Coefficients):
        np.testing.assert_equal(getattr(found, field.name), getattr(master, field.name))
    for name in ("terms", "alpha", "held_out"):
        assert getattr(found, name).dtype == np.float32
    assert found.held_out_texels.dtype == np.int64


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1)])
def test_the_smallest_sprites(size, tmp_path, rng):
    master = make(rng, size=size, held=(2, 1))
    master.save(tmp_path)
    np.testing.assert_array_equal(Coefficients.load(tmp_path).terms, master.terms)


def test_large_texel_numbers_survive_float32(tmp_path, rng):
    """A sprite has up to 8192 x 8192 texels, float32 holds whole numbers up to 4096 x 4096."""
    last = 8192 * 8192 - 1
    master = make(rng, views=1, size=(1, 8192), held=(1, 2))
    master = replace(master, held_out_texels=np.array([last, last - 1]))
    master.save(tmp_path)
    np.testing.assert_array_equal(
        Coefficients.load(tmp_path).held_out_texels, master.held_out_texels
    )


def test_damage_is_found(tmp_path, rng):
    make(rng).save(tmp_path)
    seal.seal(tmp_path)
    Coefficients.load(tmp_path)
    path = tmp_path / "terms.exr"
    data = bytearray(path.read_bytes())
    data[-100] ^= 1
    path.write_bytes(data)
    with pytest.raises(DamagedError, match=r"terms\.exr"):
        Coefficients.load(tmp_path)


def test_another_kind_is_refused(tmp_path, rng):
    make(rng).save(tmp_path)
    layout = report.read(tmp_path)
    report.write(tmp_path, {**layout, "kind": "billboard"})
    with pytest.raises(DamagedError, match="kind"):
        Coefficients.load(tmp_path)
    report.write(tmp_path, {**layout, "format": 99})
    with pytest.raises(DamagedError, match="format 99"):
        Coefficients.load(tmp_path)


def spoilt(array, value):
    changed = np.array(array)
    changed.reshape(-1)[-1] = value
    return changed


def bad_cases():
    good = make(np.random.default_rng(7))
    return good, {
        "NaN term": ("terms", spoilt(good.terms, np.nan)),
        "term beyond the largest": ("terms", spoilt(good.terms, 2 * LARGEST)),
        "a term too few": ("terms", good.terms[:, :-1]),
        "a view too few": ("terms", good.terms[:-1]),
        "integer terms": ("terms", good.terms.astype(np.int32)),
        "coverage above one": ("alpha", spoilt(good.alpha, 1.5)),
        "NaN coverage": ("alpha", spoilt(good.alpha, np.nan)),
        "negative render": ("held_out", spoilt(good.held_out, -1.0)),
        "a render too few": ("held_out", good.held_out[:-1]),
        "texel outside": ("held_out_texels", spoilt(good.held_out_texels, 42)),
        "negative texel": ("held_out_texels", spoilt(good.held_out_texels, -1)),
        "texels as floats": ("held_out_texels", good.held_out_texels.astype(float)),
        "a texel too few": ("held_out_texels", good.held_out_texels[:-1]),
    }


GOOD, BAD = bad_cases()


@pytest.mark.parametrize(("field", "value"), BAD.values(), ids=BAD)
def test_bad_arrays_are_named(field, value):
    with pytest.raises(InputError) as refusal:
        replace(GOOD, **{field: value}).checked("sprite")
    assert refusal.value.field == field
    assert str(refusal.value).startswith("sprite: " + field)


def test_good_arrays_pass_in_any_layout():
    odd = replace(GOOD, terms=GOOD.terms.astype(">f8"), alpha=np.asfortranarray(GOOD.alpha))
    checked = odd.checked()
    np.testing.assert_array_equal(checked.terms, GOOD.terms)
    assert checked.terms.dtype == np.float32
    assert checked.alpha.flags.c_contiguous


def test_an_empty_sprite_is_refused():
    empty = replace(GOOD, terms=GOOD.terms[:, :, :0], alpha=GOOD.alpha[:, :0])
    with pytest.raises(InputError):
        empty.checked()
