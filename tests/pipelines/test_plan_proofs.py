"""What a plan leaves out changes no picture by more than it says: random scenes, drawn both ways.

BAKELIGHT_PROOFS=200 runs that many scenes and prints what was left out and the time it saved.
"""

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest

from formats import scene as scenes
from formats import seal
from formats.files import image
from formats.film_bounds import HALF_FLOAT
from formats.plan import Plan
from pipelines import plan as plans
from pipelines import reports
from pipelines.bake_scene import bake_scene

SCENES = int(os.environ.get("BAKELIGHT_PROOFS", "24"))
SIZE = (64, 36)
TENT = {"name": "tent", "source": "meshes/tent.glb", "height": 1.0, "resolution": 24, "samples": 4}
FULL = {**TENT, "name": "full", "packing": "full"}
DOT = {"name": "dot", "source": "pictures/dot.png", "height": 0.5}
HOUSE = {"name": "house", "source": "meshes/tent.glb"}
SHADOW = {"shadow": {"grid": 8, "l_max": 3, "rays": 64}}
EVEN = {"type": "environment", "source": "environments/even.hdr"}
# A wide lens, so that the assets have every level that another scene may ask for
ALL = {
    "format": 1,
    "quality": "draft",
    "camera": {
        "position": [0, 1, 5],
        "target": [0, 0.5, 0],
        "lens": {"f_number": 0.5, "focus_distance": 1.0},
    },
    "lights": [EVEN],
    "meshes": [{**HOUSE, **SHADOW}],
    "billboards": [{**each, "positions": [[0, 0, 0]]} for each in (TENT, FULL, DOT)],
}
Raw = dict[str, Any]
Draw = Callable[[Raw], tuple[Plan, list[Any]]]


def some(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is evenly spread."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def keyed(rng: np.random.Generator, value: Any, other: Any) -> Any:
    """A value, one time in four on the way to another."""
    if rng.random() < 0.75:
        return value
    how = str(rng.choice(["linear", "smooth", "step"]))
    return {"times": [0.0, 0.4, 1.0], "values": [value, other, value], "interpolation": how}


def light(rng: np.random.Generator) -> Raw:
    kind = str(rng.choice(["sun", "sphere", "environment", "disc", "rectangle", "polygon"]))
    colour = (rng.uniform(0.2, 1.0, 3) * some(rng, 1e-6, 20.0)).tolist()
    place = (rng.normal(size=3) * some(rng, 1.0, 300.0)).tolist()
    towards = rng.normal(size=3).tolist()
    if kind == "sun":
        return {"type": kind, "to_light": towards, "irradiance": keyed(rng, colour, [0, 0, 0])}
    if kind == "environment":
        return {**EVEN, "scale": some(rng, 1e-6, 2.0) if rng.random() < 0.9 else 0.0}
    size = some(rng, 1e-2, 2.0)
    if kind == "polygon":
        corners = (np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]]) * size + place).tolist()
        return {"type": kind, "outline": corners, "radiance": colour, "two_sided": True}
    raw = {"type": kind, "position": keyed(rng, place, [1.0, 2.0, 3.0]), "radiance": colour}
    if kind == "sphere":
        return {**raw, "radius": size}
    shape = {"radius": size} if kind == "disc" else {"size": [size, 2 * size]}
    return {**raw, **shape, "facing": towards, "two_sided": bool(rng.random() < 0.5)}


def camera(rng: np.random.Generator) -> Raw:
    eye, aim = rng.uniform([-4, 0.3, 2], [4, 4, 9]), rng.uniform([-1, 0, -1], [1, 1, 1])
    if rng.random() < 0.3:
        # From above: the ground fills the picture
        eye = rng.uniform([-0.5, 3, 0.1], [0.5, 12, 0.6])
        aim = np.array([0.0, 0.0, 0.0])
    elif rng.random() < 0.2:
        aim = eye + np.array([0.0, rng.uniform(0.5, 2.0), -0.5])
    there = (eye + rng.uniform(-1, 1, 3) * 0.3).tolist()
    found = {"position": keyed(rng, eye.tolist(), there), "target": aim.tolist()}
    if rng.random() < 0.6:
        focus = some(rng, 0.5, 50.0)
        numbers = some(rng, 1.4, 64.0), some(rng, 1.4, 64.0)
        found["lens"] = {
            "f_number": keyed(rng, *numbers),
            "focus_distance": keyed(rng, focus, 2 * focus),
        }
    return found


def random_scene(rng: np.random.Generator) -> Raw:
    picture: Raw = {
        "film": {
            "exposure": keyed(rng, *rng.uniform(-6, 6, 2).tolist()),
            "tonemap": str(rng.choice(["linear", "filmic"])),
            "vignette": float(rng.choice([0.0, 0.5])),
        }
    }
    if rng.random() < 0.5:
        picture["sky"] = {"zenith": [0.1, 0.2, 0.5], "horizon": [0.6, 0.6, 0.6]}
        if rng.random() < 0.3:
            picture["sky"]["glow"] = [1.0, 0.8, 0.5]
    if rng.random() < 0.6:
        amount = 0.0 if rng.random() < 0.2 else some(rng, 1e-9, 1.0)
        falloff = 0.0 if rng.random() < 0.5 else 0.3
        tint = (rng.uniform(0, 1, 3) * some(rng, 1e-3, 1.0)).tolist()
        picture["fog"] = {"extinction": amount, "radiance": tint, "falloff": falloff}
    raw: Raw = {
        "format": 1,
        "quality": "draft",
        "time": {"duration": 1.0, "frame_rate": 8},
        "camera": camera(rng),
        "lights": [light(rng) for _ in range(rng.integers(0, 6))],
        "picture": picture,
    }
    if rng.random() < 0.6:
        raw["ground"] = {"accent": [0.3, 0.2, 0.1]}
    if rng.random() < 0.75:
        spread = [[3, 0, 3], [40, 0, 40]][int(rng.random() < 0.3)]
        chosen = [TENT, FULL][: int(rng.integers(1, 3))]
        raw["billboards"] = [
            {**each, "positions": (rng.uniform(-1, 1, (3, 3)) * spread).tolist()} for each in chosen
        ]
        if rng.random() < 0.15:
            raw["billboards"] = [{**TENT, "positions": [[0, 0, 90]], "shadow": False}]
    if rng.random() < 0.35:
        where = rng.uniform([-3, 0, -6], [3, 0.5, 12]).tolist()
        raw["meshes"] = [{**HOUSE, "position": keyed(rng, where, [0.0, 0.0, 0.0])}]
        if rng.random() < 0.7:
            where[1] += some(rng, 1.0, 3000.0) if rng.random() < 0.5 else 0.0
            raw["meshes"] = [{**HOUSE, **SHADOW, "position": where}]
    if rng.random() < 0.5:
        threshold = 0.0 if rng.random() < 0.3 else some(rng, 1e-3, 100.0)
        strength = keyed(rng, some(rng, 1e-4, 1.0), 0.0)
        radius = some(rng, 0.01, 0.5)
        picture["bloom"] = {"strength": strength, "threshold": threshold, "radius": radius}
    if rng.random() < 0.25:
        centre = rng.uniform(0, 1, 2).tolist()
        picture["radial_blur"] = {"strength": some(rng, 1e-3, 0.5), "centre": centre}
    for mesh in raw.get("meshes", []):
        if rng.random() < 0.6:
            mesh["silhouette_width"] = some(rng, 1e-3, 1.0)
            mesh["silhouette_softness"] = some(rng, 0.1, 4.0)
    add_light_in_the_air(rng, raw)
    return raw


def add_light_in_the_air(rng: np.random.Generator, raw: Raw) -> None:
    """Pictures and particles, some of them far away, dark, or never born."""
    colour = (rng.uniform(0, 1, 3) * some(rng, 1e-3, 10.0)).tolist()
    if rng.random() < 0.3:
        spread = [[3, 2, 3], [40, 9, 40]][int(rng.random() < 0.3)]
        places = (rng.uniform(-1, 1, (4, 3)) * spread).tolist()
        looks = {"facing": str(rng.choice(["camera", "upright"])), "radiance": colour}
        looks |= {"roll": rng.uniform(-180, 180, 4).tolist(), "opacity": float(rng.choice([0, 1]))}
        looks |= {"softness": 0.3} if rng.random() < 0.3 else {}
        raw["billboards"] = [*raw.get("billboards", []), {**DOT, "positions": places, **looks}]
    if rng.random() < 0.5:
        drawn = [each["name"] for each in raw.get("billboards", [])]
        centre = (rng.normal(size=3) * some(rng, 0.3, 60.0)).tolist()
        look: Raw = {"radius": some(rng, 1e-3, 0.5), "radiance": colour}
        if drawn and rng.random() < 0.4:
            look = {"billboard": str(rng.choice(drawn)), "scale": some(rng, 0.3, 2.0)}
        rate = 0.0 if rng.random() < 0.15 else some(rng, 0.5, 10.0)
        raw["particles"] = [
            {
                "name": "embers",
                "emitter": {
                    "seed": int(rng.integers(1000)),
                    "rate": rate,
                    "lifetime": [0.5, 2.0],
                    "centre": keyed(rng, centre, [0.0, 1.0, 0.0]),
                    "half_size": [1.0, 0.5, 1.0],
                },
                "motion": {"velocity": rng.normal(size=3).tolist(), "turbulence": 0.3},
                "look": look,
            }
        ]


def everything(raw: Raw) -> Raw:
    """Force on all that a scene describes, and every light."""
    described = {
        "surface": "meshes" in raw,
        "occlusion": any("shadow" in each for each in raw.get("meshes", [])),
        "silhouette": any("silhouette_width" in each for each in raw.get("meshes", [])),
        "billboard": "billboards" in raw or "particles" in raw,
        "particles": "particles" in raw,
        "ground": "ground" in raw,
        "environment": any(each["type"] == "environment" for each in raw["lights"]),
        "sky": "sky" in raw["picture"],
        "fog": "fog" in raw["picture"],
        "bloom": "bloom" in raw["picture"],
        "radial_blur": "radial_blur" in raw["picture"],
        "depth_of_field": "lens" in raw["camera"],
        # Without meshes the ground has a blur of its own instead
        "defocus": "lens" in raw["camera"] and "meshes" in raw,
        "lights": True,
    }
    return {**raw, "force": {name: True for name, there in described.items() if there}}


@pytest.fixture(scope="module")
def drawing(
    writing_assets: Callable[[Path], Path], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Draw]:
    """Return draw(raw) -> its plan and, at three moments, (picture, milliseconds)."""
    from runtime import player as players
    from runtime.capture import make_context

    root = writing_assets(tmp_path_factory.mktemp("proofs") / "assets")
    (root / "scenes/everything.json").write_text(json.dumps(ALL))
    (root / "pictures").mkdir()
    y, x = np.mgrid[-1:1:24j, -1:1:24j]
    dot = np.stack([1 + 0 * x, 0.6 + 0.3 * x, 0.5 + 0.4 * y, np.hypot(x, y) < 0.9], axis=-1)
    image.write(root / "pictures/dot.png", dot)
    done = bake_scene(root / "scenes/everything.json", build_folder=root / "build")
    folders = {name: entry.path for name, entry in done.entries.items()}
    context, kept = make_context(), {}

    class Shared(players.Programs):
        """Programs that outlive their player: many scenes ask for the same."""

        def __init__(self, ctx: Any) -> None:
            super().__init__(ctx)
            self._made = kept

        def release(self) -> None:
            """Keep them."""

    number = iter(range(1_000_000))

    def draw(raw: Raw) -> tuple[Plan, list[Any]]:
        assets = {f"billboard/{b['name']}": "" for b in raw.get("billboards", [])}
        assets |= {f"mesh/{m['name']}": "" for m in raw.get("meshes", [])}
        assets |= {f"occlusion/{m['name']}": "" for m in raw.get("meshes", []) if "shadow" in m}
        for i, each in enumerate(raw["lights"]):
            if each["type"] == "environment":
                assets[f"environment/{i}"] = "environment/0"
        where = {name: folders[of or name] for name, of in assets.items()}
        scene = scenes.from_dict(raw, where="proof.json", root=None)
        made = plans.build(scene, lines=SIZE[1], reports=reports.of_entries(where.items()))
        folder = root / f"baked{next(number)}"
        folder.mkdir()
        needed = {asset.name for asset in made.assets}
        manifest = {
            "format": 1,
            "name": "proof",
            "scene": raw,
            "plan": made.as_dict(),
            "assets": {n: os.path.relpath(p, folder) for n, p in where.items() if n in needed},
        }
        (folder / "manifest.json").write_text(json.dumps(manifest))
        seal.seal(folder)
        pictures = []
        with players.Player(folder, size=SIZE, context=context) as player:
            player.reuse = False
            # The first frame makes the targets
            player.frame(0.0)
            for time in (0.0, 0.37, 0.8):
                started = perf_counter()
                picture = player.frame(time)[..., :3].astype(int)
                pictures.append((picture, 1e3 * (perf_counter() - started)))
        return made, pictures

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(players, "Programs", Shared)
        yield draw
    for program in kept.values():
        program.release()
    context.release()


@pytest.mark.gpu
def test_a_light_that_counts_is_missed_where_it_is_taken_out(drawing: Draw) -> None:
    """The comparison below sees a light of a few codes go."""
    raw = {**ALL, "meshes": [], "ground": {}, "picture": {"film": {"tonemap": "linear"}}}
    raw["lights"] = [{"type": "sun", "to_light": [0, 1, 1], "irradiance": [0.01, 0.01, 0.01]}]
    planned, pictures = drawing(raw)
    _, without = drawing({**raw, "lights": []})
    assert planned.lights[0].kept
    difference = max(np.abs(a - b).max() for (a, _), (b, _) in zip(pictures, without, strict=True))
    assert 1 < difference <= (planned.lights[0].codes or 0.0) + 1


@pytest.mark.gpu
def test_what_is_left_out_changes_no_pixel_by_more_than_its_bound(drawing: Draw) -> None:
    skipped, of, dropped, lamps, worst, false = {}, {}, 0, 0, 0.0, []
    spent, bounds = np.zeros(2), []
    for seed in range(SCENES):
        raw = random_scene(np.random.default_rng(seed))
        planned, pictures = drawing(raw)
        full, truth = drawing(everything(raw))
        forced = set(full.called)
        for name in forced - {"film"}:
            of[name] = of.get(name, 0) + 1
            skipped[name] = skipped.get(name, 0) + (name not in planned.called)
        lamps += len(planned.lights)
        dropped += sum(not each.kept for each in planned.lights)
        bounds.append(planned.left_out)
        # Layers of half floats that may round another way: opaque, fog, lens, streaks, bloom there
        # and back on its levels, and each sprite
        layers = 11 + planned.sprites if planned.left_out > 0 else 0
        most = np.ceil(planned.left_out + layers * HALF_FLOAT)
        for (picture, ms), (wanted, all_ms) in zip(pictures, truth, strict=True):
            difference = float(np.abs(picture - wanted).max())
            worst = max(worst, difference)
            spent += [ms, all_ms]
            if difference > most:
                false.append((seed, difference, planned.left_out, forced - set(planned.called)))
    share = {name: f"{skipped[name]}/{of[name]}" for name in sorted(of)}
    print(
        f"\n{SCENES} scenes: left out {share}, lights {dropped}/{lamps}; worst difference "
        f"{worst:.0f} codes, largest bound {max(bounds):.3g}; frames {spent[0]:.0f} ms of "
        f"{spent[1]:.0f} ms ({1 - spent[0] / spent[1]:.0%} saved); false skips {len(false)}"
    )
    assert false == []
    # The test must have something to fail on
    assert dropped > 0
    assert sum(skipped.values()) > SCENES // 4
