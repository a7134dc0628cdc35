"""Sums over a plan and its form in JSON."""

import json

from formats.plan import FRAME, LINES, AssetPlan, EffectPlan, Plan

PLAN = Plan(
    "grove",
    LINES,
    (
        EffectPlan("environment", True, "one light", 0.5, "x radiance", False, ("environment",)),
        EffectPlan("fog", False, "no fog", None, "", False, ("haze",)),
        EffectPlan("billboard", True, "two sprites", 2.0, "sprites", True, ("billboard",)),
        EffectPlan("depth_of_field", True, "wide open", 9.0, "px", False, ("billboard",)),
    ),
    (
        AssetPlan("environment/0", "environment", "a.exr", 0.5, False, 100),
        AssetPlan("billboard/oak", "billboard", "oak.glb", 2.25, True, 1000),
    ),
    2,
)


def test_called_effects_and_their_kinds_stand_once_in_order() -> None:
    assert PLAN.called == ("environment", "billboard", "depth_of_field")
    assert PLAN.kinds == ("environment", "billboard")


def test_costs_add_up() -> None:
    assert PLAN.seconds == 2.75
    assert PLAN.bytes == 1100


def test_the_dictionary_is_json_and_complete() -> None:
    found = json.loads(json.dumps(PLAN.as_dict(), allow_nan=False))
    assert found["effects"][2] == {
        "name": "billboard",
        "called": True,
        "reason": "two sprites",
        "bound": 2.0,
        "unit": "sprites",
        "forced": True,
        "kinds": ["billboard"],
    }
    assert found["assets"][1]["seconds"] == 2.25
    assert (found["scene"], found["lines"], found["sprites"]) == ("grove", 1080, 2)
    assert (found["kinds"], found["seconds"]) == (["environment", "billboard"], 2.75)


def test_the_frame_names_each_effect_once() -> None:
    assert len(set(FRAME)) == len(FRAME)
    assert FRAME[-1] == "film"
