"""The studies `price` and `presets`: what they buy and bake, and how their answers are counted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bake import billboard
from formats import scene as scenes
from pipelines import plan as plans
from pipelines import price_plan
from pipelines.studies import presets, presets_of, price, price_cases
from pipelines.studies.answer import Row
from pipelines.studies.subjects import Setting


def test_scenes_that_are_bought_are_sound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("BAKELIGHT_DATA", raising=False)
    kinds = set()
    for path in price_cases.scene_files(Setting(), tmp_path):
        scene = scenes.load(path)
        names = [asset.name for asset in plans.build(scene).assets]
        priced = [name for name in names if price_plan.has_price(scene, name)]
        assert len(priced) >= 2
        kinds |= {name.split("/")[0] for name in priced}
    assert {"billboard", "occlusion", "transfer"} <= kinds


def test_lumps_are_closed_and_differ(tmp_path: Path) -> None:
    lumps = [price_cases.blob(tmp_path / f"{n}.obj", n, 12, 6).read_text() for n in (0, 1)]
    faces = [line.split()[1:] for line in lumps[0].splitlines() if line.startswith("f")]
    edges = {(f[k], f[(k + 1) % len(f)]) for f in faces for k in range(len(f))}
    # Every edge is passed once each way
    assert {(b, a) for a, b in edges} == edges
    assert lumps[0] != lumps[1]


def test_purchases_are_counted() -> None:
    rows: list[Row] = [
        {"series": "ring", "subject": "a", "promised": 0.1, "error": 0.09, "of_target": 0.9,
         "of_cheapest": 1.0, "of_budget": 0.8, "bakes": 1},
        {"series": "ring", "subject": "b", "promised": 0.1, "error": 0.12, "of_target": 1.2,
         "of_cheapest": 2.5, "of_budget": 1.3, "bakes": 2},
    ]  # fmt: skip
    figures = price.answered(rows).figures
    assert figures == {
        "assets": 2, "within_target": 1, "worst_of_target": 1.2, "within_twice_cheapest": 1,
        "within_budget": 1, "within_target_at_first": 1,
    }  # fmt: skip


def test_the_cheapest_has_as_few_bytes_and_an_error_as_small() -> None:
    row: Row = {"subject": "a", "error": 0.1, "bake_seconds": 8.0, "bytes": 10}
    others: list[Row] = [
        row,
        row | {"error": 0.104, "bake_seconds": 2.0},
        row | {"error": 0.106, "bake_seconds": 1.0},  # errs more
        row | {"bytes": 11, "bake_seconds": 0.5},  # is larger
        row | {"subject": "b", "bake_seconds": 0.1},
    ]
    assert presets.cheapest(row, others) == 2.0


def test_a_ramp_is_looked_up_exactly() -> None:
    row, column = np.mgrid[:5, :7]
    planes = np.repeat((3.0 * row - 2.0 * column)[None, ..., None], 4, axis=-1)
    at = np.array([[0.25, 3.5]]), np.array([[5.75, 0.0]])
    found = presets_of.bilinear(planes, *at)
    np.testing.assert_allclose(found[0, ..., 0], 3 * at[0] - 2 * at[1], atol=1e-12)


def test_finer_sprites_are_nearer_on_the_screen(tmp_path: Path) -> None:
    screen = presets_of.Screen(price_cases.blob(tmp_path / "lump.obj", 9), 48)
    errors = []
    for texels in (12, 48, 96):
        params = billboard.Params(resolution=texels, samples=8, lights=16, held_out=0)
        errors.append(screen.tried(params, "").error.value)
    # A texel a pixel leaves what five terms cannot tell; a quarter of it blurs; the border of the
    # lump dominates both
    assert errors[0] > 1.5 * errors[1]
    # Twice the texels, drawn from their next level, are the same pixels within its filter
    assert errors[2] < 1.2 * errors[1]
