"""Which lights a plan leaves out: closed forms, the budget of one code, what keeps one anyway."""

from typing import Any

import numpy as np
import pytest

from formats import effects, film_bounds, scene
from formats.errors import InputError
from formats.plan import LightPlan
from maths import (
    area_lights,
    circular_harmonics,
    colour,
    disc_lights,
    polygon_lights,
    spherical_harmonics,
    spherical_projection,
)

LINEAR = {"picture": {"film": {"tonemap": "linear"}}}
UP = np.array([0.0, 1.0, 0.0])


def made(*lights: dict[str, Any], **parts: Any) -> scene.Scene:
    """A white ground under some lights, developed by the linear curve."""
    raw: dict[str, Any] = {
        "format": 1,
        "camera": {"position": [0, 1, 10], "target": [0, 1, 0]},
        "lights": list(lights),
        "ground": {"albedo": [1, 1, 1]},
        **LINEAR,
        **parts,
    }
    return scene.from_dict(raw, where="a.toml", root=None)


def plans(*lights: dict[str, Any], reports: Any = None, **parts: Any) -> tuple[LightPlan, ...]:
    return effects.lights(made(*lights, **parts), reports)


def sun(irradiance: float, **more: Any) -> dict[str, Any]:
    return {"type": "sun", "to_light": [0, 1, 1], "irradiance": [irradiance, 0, 0], **more}


def of_codes(codes: float) -> float:
    """Irradiance that puts so many codes on white."""
    return float(np.pi * colour.srgb_decode(codes / 255))


@pytest.mark.parametrize(("codes", "kept"), [(0.49, False), (0.51, True), (90.0, True)])
def test_a_sun_is_bounded_by_what_white_returns(codes: float, kept: bool) -> None:
    (found,) = plans(sun(of_codes(codes)))
    assert found.kept is kept
    assert found.codes == pytest.approx(codes, rel=1e-9)
    assert found.reason.startswith("it adds at most")


def test_what_lights_nothing_adds_nothing() -> None:
    (found,) = plans(sun(0.0))
    assert (found.kept, found.codes) == (False, 0.0)
    bare = scene.from_dict(
        {"format": 1, "camera": {"position": [0, 1, 9], "target": [0, 1, 0]}, "lights": [sun(9.0)]},
        where="a.toml",
        root=None,
    )
    assert not effects.lights(bare)[0].kept


def test_left_out_lights_share_one_code() -> None:
    dim = [sun(of_codes(codes)) for codes in (0.2, 0.22, 0.15)]
    found = plans(*dim)
    # With several suns each counts twice: 0.3 + 0.4 fit into one code, 0.44 does not
    assert [each.kept for each in found] == [False, True, False]
    assert sum(each.codes or 0.0 for each in found if not each.kept) < 1.0
    assert "used the one code up" in found[1].reason


@pytest.mark.parametrize("kind", ["sphere", "disc", "rectangle", "polygon"])
def test_near_lights_shine_no_brighter_than_said(kind: str, rng: np.random.Generator) -> None:
    for _ in range(20):
        middle, towards = rng.uniform([-2, 0.1, -2], [2, 4, 2]), rng.normal(size=3)
        towards /= np.linalg.norm(towards)
        size, radiance = rng.uniform(0.05, 1.0), np.full(3, 1e-3)
        raw: dict[str, Any] = {"type": kind, "radiance": radiance.tolist()}
        where = {"position": middle.tolist(), "facing": towards.tolist(), "two_sided": True}
        points = np.concatenate([rng.uniform(-3, 3, (400, 3)), middle + rng.normal(size=(9, 3))])
        points[:, 1] = 0.0
        if kind == "sphere":
            raw |= {"position": middle.tolist(), "radius": size}
            shone = area_lights.sphere_irradiance(points, UP, middle, size, radiance)
        elif kind == "disc":
            raw |= {**where, "radius": size}
            shone = disc_lights.disc_irradiance(
                points, UP, middle, towards, size, radiance, two_sided=True
            )
        else:
            corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * size + middle
            raw |= {"outline": corners.tolist(), "two_sided": True}
            if kind == "rectangle":
                raw = {"type": kind, "radiance": raw["radiance"], **where, "size": [size, size]}
                corners = made(raw).lights[0].corners(0.0)  # type: ignore[union-attr]
            shone = polygon_lights.polygon_irradiance(points, UP, corners, radiance, two_sided=True)
        codes = 255 * colour.srgb_encode(np.asarray(shone) / np.pi).max()
        bound = plans(raw)[0].codes
        assert bound is not None
        assert codes <= bound * (1 + 1e-9)


def sprites(terms: int = 5, packing: str = "full") -> tuple[dict[str, Any], dict[str, Any]]:
    """A set of three sprites, and its report, whose coefficients reach their scales."""
    place = {"name": "oak", "source": "oak.glb", "height": 1.0, "positions": [[0, 0, 0]] * 3}
    ring = {"axis": "view", "elevation": 0.5, "terms": terms, "one_sided": True, "lights": 64}
    scales = np.full((terms if packing == "full" else 3, 4), 0.25)
    layout = {"scales": scales.tolist(), "packing": packing, "unpack": "chroma", "ring": ring}
    layout |= {"metres_per_texel": 0.1, "height": 1.0, "pivot": [5, 10], "lens_scale": 1.0}
    report = {"kind": "billboard", "layout": layout, "size": [10, 12]}
    return place, {"billboard/oak": report}


def test_sprites_return_no_more_than_said(rng: np.random.Generator) -> None:
    place, reports = sprites()
    irradiance = 1e-5
    (found,) = plans(sun(irradiance), billboards=[place], reports=reports)
    worst = 0.0
    for direction in rng.normal(size=(500, 3)):
        L = circular_harmonics.project_sun(direction, [irradiance], 5, elevation=0.5)
        # The coefficients of the worst texel have the signs of the light's
        worst = max(worst, 0.25 * float(np.abs(L).sum()))
    bound = 255 * colour.srgb_encode(irradiance / np.pi + 3 * worst)
    assert found.codes is not None
    assert float(bound) <= found.codes < 1.5 * float(bound)


def test_what_is_not_baked_keeps_its_lights() -> None:
    place, reports = sprites(packing="twelve")
    (unknown,) = plans(sun(1e-9), billboards=[place])
    assert (unknown.kept, unknown.codes) == (True, None)
    assert not plans(sun(1e-9), billboards=[place], reports=reports)[0].kept
    environment = {"type": "environment", "source": "a.exr", "scale": 1e-6}
    assert plans(environment)[0].kept
    known = {"environment/0": {"mean_radiance": [1.0, 1.0, 1.0]}}
    (found,) = plans(environment, reports=known)
    assert not found.kept
    decided = {e.name: e for e in effects.decide(made(environment), known)}["environment"]
    assert (decided.called, decided.codes) == (False, found.codes)


def test_a_sun_that_others_lean_on_stays() -> None:
    glow = {"sky": {"zenith": [0, 0, 1], "horizon": [1, 1, 1], "glow": [1, 1, 1]}}
    first, second = plans(sun(1e-9), sun(1e-9), picture=glow)
    assert "the sky glows around it" in first.reason
    assert (first.kept, second.kept) == (True, False)
    # Only three suns throw shadows: a fourth must not move up
    four = plans(*[sun(1e-9)] * 4)
    assert [each.kept for each in four] == [True, True, True, False]
    assert "shadows of sun 3" in four[0].reason


def test_lights_can_be_forced() -> None:
    environment = {"type": "environment", "source": "a.exr"}
    every = plans(sun(0.0), environment, force={"lights": True})
    assert [each.kept for each in every] == [True, True]
    assert every[0].reason.startswith("forced on, although it adds at most 0")
    off = plans(environment, force={"environment": False})
    assert (off[0].kept, off[0].reason[:10]) == (False, "forced off")
    on = plans({**environment, "scale": 0.0}, force={"environment": True})
    assert on[0].kept
    with pytest.raises(InputError, match=r"force\.lights"):
        plans(sun(1.0), force={"lights": False})


def test_transfer_makes_no_more_of_a_sun_than_said(rng: np.random.Generator) -> None:
    """Whatever is hidden: vectors of random visibility, the brightest direction of light."""
    rock = {"name": "rock", "source": "rock.glb", "lighting": "transfer"}
    knobs = {"transfer": {"l_max": 4, "bounces": 0}}
    film = {"film": {"tonemap": "linear"}}
    (plan,) = plans(sun(1e-3), meshes=[{**rock, **knobs}], picture=film)
    toward, area = spherical_projection.quadrature(24)
    basis = spherical_harmonics.evaluate(toward, 4)
    cosine = np.maximum(toward[:, 2], 0) * area
    # Smooth random functions cut at 0: what is seen comes in patches
    patches = basis @ rng.normal(size=(25, 64)) > rng.normal(size=64)
    vectors = (patches * cosine[:, None]).T @ basis
    most = 1e-3 * float((vectors @ basis.T).max()) / np.pi
    bound = film_bounds.added(made(sun(1e-3), picture=film).picture.film, most)
    assert plan.codes is not None
    assert 0.5 * plan.codes < bound <= plan.codes
    (twice,) = plans(sun(1e-3), meshes=[{**rock, "transfer": {"bounces": 1}}], picture=film)
    assert twice.codes is not None
    assert twice.codes > 1.5 * plan.codes
