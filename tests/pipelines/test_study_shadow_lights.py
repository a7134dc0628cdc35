"""The study of the frame's cost by lights: what it shows is what it says."""

import numpy as np
import pytest

from formats import scene
from formats.lights import Disc, Sphere
from pipelines.plan import build
from pipelines.studies import bench, shadow_lights


@pytest.mark.parametrize("kind", shadow_lights.KINDS)
@pytest.mark.parametrize("count", [1, 300])
def test_lamps_are_as_many_as_asked_and_as_bright_together(kind: str, count: int) -> None:
    found = shadow_lights.lamps(kind, count)
    assert len(found) == count
    assert all(isinstance(lamp, {"balls": Sphere, "discs": Disc}[kind]) for lamp in found)
    at = np.array([lamp.position.at(0.0) for lamp in found])
    assert at[:, 1].min() > 0
    # Each is .5 to 1.5 of its share
    shone = sum(np.pi * lamp.radius**2 * lamp.radiance.at(0.0) for lamp in found)
    assert np.all(np.abs(shone / shadow_lights.FLUX - 1) < (0.5 if count == 1 else 0.1))


@pytest.mark.parametrize("way", shadow_lights.WAYS)
def test_every_floor_calls_for_the_shadow(way: str) -> None:
    data = shadow_lights.described(way, "bust.glb")
    described = scene.from_dict(data, where="lights.json", root=None)
    called = {e.name for e in build(described).effects if e.called}
    assert {"occlusion", "transfer"} <= called
    assert ("ground" in called) == (way == "ground")
    assert described.meshes[0].shadow.receiver_normal == (way == "receiver_normal")


def test_the_bench_knows_the_bake_of_a_volume() -> None:
    assert bench.PARTS["shadows"] is bench.shadows
    assert bench.Figure("ratio", 1.2, "", bench.AIM_SHADOWS).verdict == "met"
