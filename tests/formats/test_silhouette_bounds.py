"""When fins are called for, and how wide they are at most."""

from typing import Any

import numpy as np
import pytest

from formats import effects, scene
from formats.errors import InputError
from formats.plan import EffectPlan
from formats.silhouette_bounds import LEAST_PIXELS

HEAD = {"name": "head", "source": "head.glb", "silhouette_width": 0.01}
REPORTS = {"mesh/head": {"bounds": [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]}}


def made(*meshes: dict[str, Any], **more: Any) -> scene.Scene:
    raw = {
        "format": 1,
        "camera": {"position": [0, 0, 11], "target": [0, 0, 0], "focal_length_mm": 24.0},
        "lights": [{"type": "sun", "to_light": [0, 1, 0], "irradiance": [1.0, 1.0, 1.0]}],
        "meshes": list(meshes),
        **more,
    }
    return scene.from_dict(raw, where="a.toml", root=None)


def decided(found: scene.Scene, lines: int = 1000, reports: Any = None) -> EffectPlan:
    reports = REPORTS if reports is None else reports
    return {each.name: each for each in effects.decide(found, reports, lines)}["silhouette"]


def test_the_width_in_pixels_is_that_at_the_nearest_point() -> None:
    plan = decided(made(HEAD))
    # Focal length and sensor are alike: 0.01 m at 10 m are 1 of 1000 lines
    assert plan.called
    assert plan.bound == pytest.approx(1.0)
    assert plan.unit == "px"
    assert plan.reason == "the widest fins have 1 px of 1000 lines (head at 10 m)"
    assert decided(made(HEAD), 2000).bound == pytest.approx(2.0)
    wide = decided(made({**HEAD, "scale": 2.0}))
    assert wide.bound == pytest.approx(10.0 / 9.0)


def test_under_half_a_pixel_they_are_left_out() -> None:
    plan = decided(made(HEAD), 499)
    assert (plan.called, plan.codes) == (False, 0.0)
    assert plan.bound == pytest.approx(0.499)
    assert plan.reason.endswith("; under half a pixel there are none")
    assert decided(made(HEAD), 501).called
    assert LEAST_PIXELS == 0.5


def test_no_width_no_mesh_and_none_in_sight_call_for_none() -> None:
    without = {key: value for key, value in HEAD.items() if key != "silhouette_width"}
    for found in (made(), made(without), made(HEAD, force={"surface": False})):
        assert decided(found).reason == "no mesh has a silhouette_width"
        assert not decided(found).called
    behind = decided(made({**HEAD, "position": [0, 0, 30]}))
    assert (behind.called, behind.codes) == (False, 0.0)
    assert behind.reason == "no mesh with a silhouette_width is ever seen"
    # What is not baked may be as near as the near plane
    assert decided(made(HEAD), 10, {}).called


def test_the_nearest_moment_of_a_moving_camera_counts() -> None:
    way = {"times": [0, 1], "values": [[0, 0, 11], [0, 0, 3]]}
    camera = {"position": way, "target": [0, 0, 0], "focal_length_mm": 24.0}
    plan = decided(made(HEAD, camera=camera, time={"duration": 1.0, "frame_rate": 24}))
    assert plan.bound is not None
    # Two metres from the ball's front at the end; that of a corner's ray is shorter by its cosine
    assert 5.0 <= plan.bound < 10.0


def test_forcing_needs_a_width() -> None:
    with pytest.raises(InputError, match=r"add meshes\.silhouette_width"):
        decided(made({**HEAD, "silhouette_width": 0.0}, force={"silhouette": True}))
    assert decided(made(HEAD, force={"silhouette": True}), 100).called
    assert not decided(made(HEAD, force={"silhouette": False})).called


@pytest.mark.parametrize("value", [-1.0, np.inf, "wide"])
def test_widths_out_of_range_are_refused(value: Any) -> None:
    with pytest.raises(InputError, match="silhouette_width"):
        made({**HEAD, "silhouette_width": value})
