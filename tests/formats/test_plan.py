"""Sums over a plan and its form in JSON."""

import json

from formats.plan import FRAME, LINES, AssetPlan, EffectPlan, LightPlan, Plan

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
        "codes": 0.0,
        "seconds": 0.0,
        "bytes": 0,
        "milliseconds": 0.0,
        "timed": "estimate",
    }
    assert found["assets"][1]["seconds"] == 2.25
    assert (found["scene"], found["lines"], found["sprites"]) == ("grove", 1080, 2)
    assert (found["kinds"], found["seconds"]) == (["environment", "billboard"], 2.75)


def test_what_is_left_out_adds_up_without_what_was_forced() -> None:
    effects = (
        EffectPlan("environment", False, "dim", codes=0.3),
        EffectPlan("fog", False, "thin", codes=0.2),
        EffectPlan("sky", False, "forced off, although", forced=True, codes=255.0),
        EffectPlan("film", True, "", codes=255.0, milliseconds=3.0),
    )
    lights = (
        LightPlan(0, "environment", False, "it adds", 0.3),
        LightPlan(1, "sun", True, "it adds", 90.0),
        LightPlan(2, "environment", False, "forced off with the environment; it adds", 255.0),
    )
    plan = Plan("grove", LINES, effects, (), 0, lights)
    # The light of the environment once, the fog, and nothing that a person chose
    assert plan.left_out == 0.3 + 0.2
    assert plan.milliseconds == 3.0


def test_the_frame_names_each_effect_once() -> None:
    assert len(set(FRAME)) == len(FRAME)
    assert FRAME[-1] == "film"
