"""How far a shadow counts: bounds against balls, whose harmonics are known in closed form."""

import numpy as np
import pytest

from formats import effects, occlusion_bounds, scene
from maths.occlusion_shadow import occlusion_falloff, outside
from maths.spherical_harmonics import turn_zonal
from maths.spherical_lights import project_sun
from maths.spherical_projection import cap

BALL = [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]
SUN = {"type": "sun", "to_light": [0.2, 1, 0.1], "irradiance": [3, 3, 3]}


def described(meshes, **more):
    raw = {
        "format": 1,
        "camera": {"position": [0, 1, 5], "target": [0, 0, 0]},
        "lights": [SUN],
        "meshes": [{"source": "meshes/a.glb", **mesh} for mesh in meshes],
        **more,
    }
    return scene.from_dict(raw, where="small.toml", root=None)


def row(found, reports=None):
    return next(e for e in effects.decide(found, reports) if e.name == "occlusion")


def reports(*names):
    return {f"mesh/{name}": {"bounds": BALL} for name in names}


@pytest.mark.parametrize("l_max", [0, 2, 4, 7])
def test_no_light_loses_more_than_the_bound(l_max):
    (mesh,) = described([{"name": "a", "shadow": {"l_max": l_max}}]).meshes
    rng, worst = np.random.default_rng(l_max), 0.0
    for _ in range(200):
        p = rng.normal(size=3) * rng.uniform(1, 20)
        r = float(np.linalg.norm(2 * p))
        edge = 2 * p / outside(p)
        away = np.linalg.norm(edge)
        # As the pass does it: what the volume's edge sees of the ball, thinned
        edge_terms = turn_zonal(cap(np.arcsin(1 / away), l_max), -edge) * occlusion_falloff(
            p, [2, 2, 2]
        )
        # The brightest hiding is that of a single direction, straight behind the ball or off it
        to_light = -p / np.linalg.norm(p) + rng.choice([0.0, 0.3]) * rng.normal(size=3)
        L = project_sun(to_light, [1, 1, 1], l_max)[:, 0]
        hidden = min(1.0, float(edge_terms @ L / (2 * np.sqrt(np.pi) * L[0])))
        bound = occlusion_bounds.hidden(mesh, BALL, r)
        assert hidden <= bound
        worst = max(worst, hidden / bound)
    # The bound is no idle one: a tenth of it is met
    assert worst > 0.1


def test_a_shadow_on_the_ground_below_is_called_for():
    found = described([{"name": "a", "shadow": {}, "position": [0, 1, 0]}], ground={})
    decision = row(found, reports("a"))
    assert decision.called
    assert decision.kinds == ("occlusion",)
    assert "1 mesh casts a shadow" in decision.reason


def test_high_enough_it_is_left_out_with_a_bound_in_codes():
    found = described([{"name": "a", "shadow": {}, "position": [0, 4000, 0]}], ground={})
    decision = row(found, reports("a"))
    assert not decision.called
    assert 0 < decision.codes < 0.5
    # Unmeasured it stays
    assert row(found).called
    # So it does where nothing thins
    near = described(
        [{"name": "a", "shadow": {"falloff": False}, "position": [0, 4000, 0]}], ground={}
    )
    assert row(near, reports("a")).called
    # And where a surface may face nothing but the light that is hidden
    facing = {**found.raw["meshes"][0], "shadow": {"receiver_normal": True}}
    assert row(described([facing], ground={}), reports("a")).called


def test_it_falls_on_other_meshes_and_on_itself_only_where_asked():
    alone = {"name": "a", "shadow": {}}
    assert not row(described([alone]), reports("a")).called
    assert row(described([{**alone, "shadow": {"self": True}}]), reports("a")).called
    both = [alone, {"name": "b", "position": [3, 0, 0]}]
    assert row(described(both), reports("a", "b")).called
    far = [alone, {"name": "b", "position": [9000, 0, 0]}]
    assert not row(described(far), reports("a", "b")).called


def test_without_light_or_without_table_nothing_is_called():
    assert not row(described([{"name": "a", "shadow": {}}], ground={}, lights=[])).called
    assert not row(described([{"name": "a"}], ground={})).called
    forced = described([{"name": "a", "shadow": {}}], ground={}, force={"surface": False})
    assert not row(forced, reports("a")).called
