"""Reports as a person reads them: a line on what it is, errors beside others', losses, knobs."""

from math import pi, radians
from typing import Any

import pytest

from pipelines import told

DOME: dict[str, Any] = {
    "kind": "dome",
    "bytes": 2_500_000,
    "seal": "intact",
    "layout": {"scales": [[1.0] * 4] * 4, "channels": 15, "coverage": True, "space": "linear",
               "views": 4},
    "quality": {
        "lights": 64, "held_out_lights": 8, "held_out_psnr": 29.49, "held_out_ptm_18_psnr": 17.78,
        "held_out_hsh_27_psnr": 19.65, "leave_one_out_psnr": 30.0, "loss_channels_db": 0.22,
        "loss_coverage_db": 0.03, "loss_bits_db": 0.02, "bands": 5, "penalty": 0.1,
        "weight_exponent": 1.5, "condition": 7.71, "largest_gap_degrees": 53.2,
        "minimum": -0.017, "maximum": 1.05, "notes": ["p3.png is black"],
    },
}  # fmt: skip
RING: dict[str, Any] = {
    "kind": "billboard",
    "layout": {"scales": [[1.0] * 4] * 3, "packing": "twelve", "views": 1,
               "ring": {"axis": "view", "elevation": radians(25), "terms": 5, "lights": 21}},
    "quality": {
        "source": "photographs", "lights": 21, "lights_of_the_set": 72,
        "lowest_light_degrees": 17.9, "highest_light_degrees": 34.2, "leave_one_out_psnr": 30.9,
        "terms_used": 5, "condition": 3.12, "minimum": -0.01 / pi, "negative_texels": 0.004,
    },
}  # fmt: skip


def test_a_dome_is_told_whole() -> None:
    assert told.lines(DOME) == [
        "64 pictures under a dome: 15 numbers a pixel and coverage in 4 textures, linear values, "
        "4 views, 2.5 MB, seal intact",
        "error: 8 held-out lights: this 29.49 dB, PTM of 18 numbers 17.78 dB, HSH of 27 19.65 dB",
        "lost by: fewer numbers 0.22 dB, coverage 0.03 dB, 8 bits 0.02 dB",
        "fit: 5 bands, penalty 0.1, dark values weighted by the power 1.5, condition 7.71, "
        "largest gap 53 degrees",
        "range: lowest relit value -0.017 of a white sheet's 1, highest 1.05",
        "note: p3.png is black",
    ]


def test_a_ring_from_photographs_is_told_whole() -> None:
    assert told.lines(RING) == [
        "photographs under a ring: 21 lights of 72, at 18 to 34 degrees, about 25 degrees "
        "(axis view), 5 terms in 3 textures (twelve)",
        "error: 21 lights left out in turn: this 30.90 dB before losses",
        "fit: 5 terms used, condition 3.12",
        # A ring's values are those under irradiance 1, 1 / pi for a white sheet
        "range: lowest relit value -0.01 of a white sheet's 1, 0.4% of texels go below 0 somewhere",
    ]


@pytest.mark.parametrize(
    ("quality", "expected"),
    [
        ({"fitted_psnr": 41.0}, "the lights that were fitted: this 41.00 dB"),
        ({"leave_one_out_rms": 0.0123}, "lights left out in turn: RMS 0.012"),
        ({}, "not known"),
    ],
)
def test_the_best_known_error_is_told(quality: dict[str, Any], expected: str) -> None:
    assert told.compared(quality) == expected


@pytest.mark.parametrize("data", [{"kind": "environment", "quality": {}}, {"kind": "scene"}, {}])
def test_other_kinds_are_not_told(data: dict[str, Any]) -> None:
    assert told.lines(data) == []
