"""Colours and materials of a .vox file."""

import struct

import numpy as np
import pytest

from formats.files import vox, vox_palette
from tests.formats import vox_bytes as b


def materials(*parts: bytes) -> tuple[vox_palette.Material, ...]:
    return vox.decode(b.whole(b.ONE, *parts), "a.vox").materials


def test_default_palette() -> None:
    """Entries as the format's description prints them (0xaabbggrr)."""
    palette = vox_palette.default()
    words = np.ascontiguousarray(palette).view("<u4")[:, 0]
    printed = {
        0: 0x00000000, 1: 0xFFFFFFFF, 2: 0xFFCCFFFF, 6: 0xFF00FFFF, 7: 0xFFFFCCFF, 36: 0xFF0000FF,
        37: 0xFFFFFFCC, 215: 0xFF330000, 216: 0xFF0000EE,
        218: 0xFF0000BB, 225: 0xFF000011, 226: 0xFF00EE00, 236: 0xFFEE0000, 246: 0xFFEEEEEE,
        255: 0xFF111111,
    }  # fmt: skip
    assert {i: int(words[i]) for i in printed} == printed
    assert len(set(words.tolist())) == 256


@pytest.mark.parametrize(
    ("entries", "emission"),
    [
        ({"_type": "_emit", "_emit": "1"}, 1.0),
        ({"_type": "_emit", "_emit": "0.25", "_flux": "2"}, 25.0),
        ({"_type": "_emit", "_weight": "0.5", "_flux": "1"}, 5.0),
        ({"_type": "_emit", "_emit": "0.5", "_weight": "1", "_ldr": "0.1"}, 0.5),
        ({"_type": "_emit"}, 1.0),
        ({"_type": "_diffuse", "_emit": "0.5", "_flux": "2"}, 0.0),
        ({"_type": "_blend", "_emit": "0.16", "_flux": "3"}, 0.0),
        ({"_emit": "0.5"}, 0.0),
        ({}, 0.0),
    ],
)
def test_emission_is_weight_times_ten_to_the_flux(entries: dict[str, str], emission: float) -> None:
    found = materials(b.material(9, **entries))
    # The power and the product round once each
    assert found[9].emission == pytest.approx(emission, rel=1e-15)
    assert [m.emission for i, m in enumerate(found) if i != 9] == [0.0] * 255


def test_material_256_is_that_of_no_cell() -> None:
    assert materials(b.material(256, _type="_emit"))[0].emission == 1.0


def old(index: int, kind: int, weight: float, **values: float) -> bytes:
    names = ("plastic", "roughness", "specular", "ior", "attenuation", "power", "glow")
    bits = sum(1 << names.index(name) for name in values) | 1 << 7
    ordered = [values[name] for name in names if name in values]
    packed = struct.pack(f"<2if i{len(ordered)}f", index, kind, weight, bits, *ordered)
    return b.chunk("MATT", packed)


def test_old_materials() -> None:
    """The power of MATT, from 0 to 1, counts as a flux from 0 to 4."""
    parts = [
        old(1, 3, 0.5),
        old(2, 3, 0.5, roughness=0.75, power=0.5, glow=0.25),
        old(3, 1, 0.5, power=1.0),
    ]
    found = materials(*parts)
    assert [m.emission for m in found[:5]] == [0.0, 0.5, 50.0, 0.0, 0.0]
    assert [m.type for m in found[1:4]] == ["_emit", "_emit", "_metal"]


def test_new_materials_replace_old_ones() -> None:
    found = materials(old(1, 3, 1.0), b.material(2, _type="_emit"))
    assert [m.emission for m in found[:3]] == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("count", [1, 255, 256])
def test_palettes_of_fewer_colours(count: int) -> None:
    stored = bytes(range(1, 5)) * count
    palette = vox.decode(b.whole(b.ONE, b.chunk("RGBA", stored)), "a.vox").palette
    kept = min(count, 255)
    assert np.all(palette[1 : kept + 1] == [1, 2, 3, 4])
    assert not palette[kept + 1 :].any()
    assert not palette[0].any()
