"""Particles in a scene: what is read, refused, planned and bounded."""

from typing import Any

import numpy as np
import pytest

from formats import effects, lens_bounds, motion, particles, post, scene
from formats.errors import InputError

BASE: dict[str, Any] = {"format": 1, "camera": {"position": [0, 1, 5], "target": [0, 1, 0]}}
SET = {"name": "dot", "source": "pictures/dot.png", "height": 0.5}
MESH = {"name": "leaf", "source": "meshes/leaf.glb", "height": 0.5}


def raw(
    emitter: dict[str, Any] | None = None, look: dict[str, Any] | None = None, **more: Any
) -> dict[str, Any]:
    born = {"rate": 30, "lifetime": [2, 5], "centre": [0, 1, 0], **(emitter or {})}
    shown = {"radius": 0.01} if look is None else look
    return {"name": "embers", "emitter": born, "look": shown, **more}


def read(*found: dict[str, Any], **parts: Any) -> scene.Scene:
    content = {**BASE, "particles": list(found), **parts}
    return scene.from_dict(content, where="a.toml", root=None)


def test_what_is_written_is_read() -> None:
    found = read(raw({"seed": 7}, motion={"velocity": [0, 1, 0]})).particles[0]
    assert (found.emitter.seed, found.motion.velocity) == (7, (0.0, 1.0, 0.0))
    assert found.most == 152
    assert found.factor == (0.02, 0.02)
    assert read(raw(look={"radius": [0.1, 0.3]})).particles[0].factor == (0.2, 0.6)
    disc = found.disc()
    assert (disc.pictured, disc.stands, disc.shadow, disc.opacity) == (True, False, False, 0.0)


@pytest.mark.parametrize(
    ("found", "field", "remedy"),
    [
        (raw({"rate": 1e5}), "emitter.rate", "at most 2e+04"),
        (raw({"lifetime": [5, 2]}), "emitter.lifetime", "lesser first"),
        (raw({"lifetime": [0, 2]}), "emitter.lifetime[0]", "from 0.01"),
        (raw({"rate": float("nan")}), "emitter.rate", "finite"),
        (raw(look={}), "look.radius", "billboard"),
        (raw(look={"radius": [2, 1]}), "look.radius", "lesser first"),
        (raw(look={"billboard": "dott"}), "look.billboard", "dot"),
        (raw(look={"billboard": "dot", "radius": 1}), "look.radius", "of a disc"),
        (raw(look={"billboard": "dot", "radiance": [2, 1, 1]}), "look.radiance", "of a disc"),
        (raw(look={"billboard": "leaf", "spin": [0, 9]}), "look.spin", "only a picture"),
        (raw(look={"billboard": "dot", "roll": [9, 0]}), "look.roll", "lesser first"),
    ],
    ids=str,
)
def test_what_cannot_be_is_refused(found: dict[str, Any], field: str, remedy: str) -> None:
    with pytest.raises(InputError) as caught:
        read(found, billboards=[SET | {"positions": []}, MESH | {"positions": []}])
    assert caught.value.field == f"particles[0].{field}"
    assert remedy in caught.value.remedy


def test_a_period_holds_whole_births() -> None:
    for rate, period, births in ((30, 2.0, 60), (0.26, 10.0, 3), (0.01, 10.0, 1), (0, 10.0, 0)):
        found = read(raw({"rate": rate, "period": period})).particles[0].emitter
        assert found.cycle == births
        # births / period is rounded once, their product once more
        assert found.pace * period == pytest.approx(births, rel=3e-16)
    # The most that may live follow the births that there are, not those that were asked for
    rare = read(raw({"rate": 0.01, "period": 0.1, "lifetime": [1, 1]})).particles[0]
    assert rare.most == 12
    unbounded = read(raw()).particles[0].emitter
    assert (unbounded.cycle, unbounded.pace) == (0, 30)


def test_names_are_their_own() -> None:
    with pytest.raises(InputError, match="another name"):
        read(raw(), raw())


def test_a_set_may_have_no_places_where_particles_use_it() -> None:
    found = read(raw(look={"billboard": "dot"}), billboards=[SET])
    assert len(found.billboards[0].instances()) == 0
    with pytest.raises(InputError, match="positions or scatter"):
        read(raw(), billboards=[SET])


def decided(found: scene.Scene, name: str) -> Any:
    return next(each for each in effects.decide(found) if each.name == name)


def test_the_plan_calls_for_them_where_they_may_show() -> None:
    seen = decided(read(raw()), "particles")
    assert seen.called
    assert seen.bound == 152
    assert decided(read(raw()), "billboard").called
    behind = raw({"centre": [0, 1, 60]}, motion={"velocity": [0, 0, 1]})
    for dark in (
        raw({"rate": 0}),
        raw(look={"radius": 1, "radiance": [0, 0, 0]}),
        behind,
    ):
        found = read(dark)
        left = decided(found, "particles")
        assert not left.called
        assert (left.bound, left.codes) == (0.0, 0.0)
        assert not decided(found, "billboard").called
    # They fly into the view within their lives
    coming = raw({"centre": [0, 1, 60]}, motion={"velocity": [0, 0, -20]})
    assert decided(read(coming), "particles").called
    # A disc that is dark and covers does show
    assert decided(
        read(raw(look={"radius": 1, "radiance": [0] * 3, "opacity": 1})), "particles"
    ).called


def test_force_has_its_way() -> None:
    off = read(raw(), force={"particles": False})
    assert not decided(off, "particles").called
    assert not decided(off, "billboard").called
    with pytest.raises(InputError, match="particles"):
        effects.decide(
            scene.from_dict({**BASE, "force": {"particles": True}}, where="a", root=None)
        )


def test_they_move_for_as_long_as_the_animation_does() -> None:
    assert motion.moving(read(raw())) == ()
    assert motion.moving(read(raw(), time={"duration": 1})) == ("particles[0]",)
    assert motion.moving(read(raw({"rate": 0}), time={"duration": 1})) == ()


LENS = {**BASE["camera"], "lens": {"f_number": 1.4, "focus_distance": 5.0}}


def test_the_lens_is_called_for_by_particles_alone() -> None:
    far = read(raw({"centre": [0, 1, 3]}), camera=LENS)
    found = lens_bounds.of_sprites(far, {}, 1080)
    assert found is not None
    assert found.name == "particles embers"
    assert decided(far, "depth_of_field").called


def test_a_set_gets_the_levels_that_its_particles_ask_for() -> None:
    """Placed nowhere, all of its blur is that of its particles; the nearest and smallest counts."""
    looks = {"billboard": "dot", "scale": [0.5, 1]}
    near = raw({"centre": [0, 1, 4], "half_size": [0, 0, 0.5]}, looks)
    found = read(near, billboards=[SET], camera=LENS)
    lod = effects.largest_lod(found, found.billboards[0], 100.0)
    # f = 50 mm: the circle at half a metre is f^2 / N / (5 - f) (5 / .5 - 1) on the sensor
    circle = 0.05**2 / 1.4 / 4.95 * 9 * 0.5 / 0.05 * 100 / 0.5
    assert lod == pytest.approx(np.log2(circle), abs=0.01)
    assert effects.largest_lod(read(raw(), billboards=[SET | {"positions": []}], camera=LENS),
        found.billboards[0], 100.0) == 0  # fmt: skip


def test_bloom_knows_how_bright_they_may_be() -> None:
    one = read(raw({"rate": 0.5, "lifetime": [1, 1]}, {"radius": 1, "radiance": [3, 0, 0]}))
    # At most three at a time, over one another
    assert post.brightest(one, {}) == pytest.approx(9 * post.ROUNDING)
    pictures = read(billboards=[SET | {"positions": [[0, 0, 0]] * 2, "radiance": [4, 1, 1]}])
    assert post.brightest(pictures, {}) == pytest.approx(8 * post.ROUNDING)
    painted = {**SET, "source": "pictures/dot.exr", "positions": [[0, 0, 0]]}
    assert post.brightest(read(billboards=[painted]), {}) is None


def test_an_example_is_read() -> None:
    example = {
        "name": "embers",
        "emitter": {
            "seed": 7,
            "rate": 30,
            "lifetime": [2, 5],
            "centre": [0.8, 0.6, 0.5],
            "half_size": [0.6, 0.1, 0.4],
        },
        "motion": {"velocity": [0.05, 0.45, 0.0], "turbulence": 0.2},
        "look": {"radius": 0.008, "radiance": [18.0, 5.0, 1.0], "softness": 0.1},
    }
    low, high = read(example).particles[0].box()
    # Up to 5 s of .45 m/s, and .2 m astray
    np.testing.assert_allclose(high, [1.4 + 0.25 + 0.2, 0.7 + 2.25 + 0.2, 0.9 + 0.2])
    np.testing.assert_allclose(low, [0.0, 0.3, -0.1], atol=1e-12)
    assert particles.MOST == 100_000
