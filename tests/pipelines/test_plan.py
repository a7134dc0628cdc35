"""Plans of whole scenes: what is baked, what it costs, how it is printed."""

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from formats import scene
from formats.errors import InputError
from formats.plan import FRAME
from pipelines import plan

RAW: dict[str, Any] = {
    "format": 1,
    "camera": {
        "position": [0, 1, 10],
        "target": [0, 1, 0],
        "lens": {"f_number": 2, "focus_distance": 5},
    },
    "lights": [
        {"type": "sun", "to_light": [1, 1, 1], "irradiance": [1, 1, 1]},
        {"type": "environment", "source": "environments/dusk.exr"},
        {"type": "environment", "source": "environments/off.exr", "scale": 0},
    ],
    "ground": {},
    "billboards": [
        {"name": "oak", "source": "meshes/oak.glb", "height": 6, "positions": [[0, 0, 0]]},
        {"name": "fern", "source": "meshes/fern.glb", "height": 1, "positions": [[1, 0, 0]] * 2},
    ],
}


def made(**changes: Any) -> scene.Scene:
    return scene.from_dict({**RAW, **changes}, where="grove.toml", root=None)


def printed(found: scene.Scene, **options: Any) -> str:
    from rich.console import Console

    file = io.StringIO()
    plan.show(plan.build(found), Console(file=file, width=120, **options))
    return file.getvalue()


def test_only_what_is_called_for_is_baked() -> None:
    found = plan.build(made())
    assert [asset.name for asset in found.assets] == [
        "environment/1",
        "billboard/oak",
        "billboard/fern",
    ]
    assert found.assets[1].source == "meshes/oak.glb"
    assert found.sprites == 3
    without = plan.build(made(force={"billboard": False}))
    assert [asset.name for asset in without.assets] == ["environment/1"]
    assert without.sprites == 0
    bare = plan.build(made(lights=[], billboards=[]))
    assert bare.assets == ()
    assert bare.kinds == ()


@pytest.mark.parametrize("name", FRAME[:-1])
def test_every_kind_and_asset_is_needed_by_a_called_effect(name: str) -> None:
    found = plan.build(made(force={} if name in ("sky", "fog") else {name: False}))
    needed = {kind for effect in found.effects if effect.called for kind in effect.kinds}
    assert set(found.kinds) == needed
    assert {asset.kind for asset in found.assets} == needed


def test_meshes_are_baked_where_they_stand() -> None:
    rock = {"name": "rock", "source": "meshes/rock.glb"}
    found = plan.build(made(meshes=[rock], lights=[], billboards=[]))
    assert [(a.name, a.kind, a.source) for a in found.assets] == [
        ("mesh/rock", "mesh", "meshes/rock.glb")
    ]
    assert found.bytes > 0
    assert plan.build(made(meshes=[rock], force={"surface": False})).kinds == made_kinds()
    # Four samples a pixel, 12 bytes each: 100 MB at 1920 x 1080
    megabytes = [float(plan.summary(p).split("about ")[1].split()[0]) for p in (found, bare())]
    assert megabytes[0] - megabytes[1] == pytest.approx(
        (1920 * 1080 * 48 + found.bytes) / 1e6, abs=1
    )


def made_kinds() -> tuple[str, ...]:
    return plan.build(made()).kinds


def bare() -> Any:
    return plan.build(made(lights=[], billboards=[]))


def test_measured_seconds_replace_estimates() -> None:
    measured = {"billboard/oak": 7.5}
    found = plan.build(made(), seconds=measured.get)
    oak, fern = found.assets[1:]
    assert (oak.seconds, oak.known) == (7.5, True)
    assert fern.seconds > 0
    assert not fern.known
    assert found.seconds == sum(asset.seconds for asset in found.assets)


def test_estimates_grow_with_the_work() -> None:
    def oak(**knobs: Any) -> Any:
        sprites = {**RAW["billboards"][0], **knobs}
        return plan.build(made(billboards=[sprites])).assets[-1]

    plain = oak()
    assert oak(samples=64).seconds > plain.seconds
    assert oak(views=8).bytes == 8 * plain.bytes
    # Five full terms against the three planes that hold twelve channels
    assert oak(packing="full").bytes == pytest.approx(plain.bytes * 5 / 3, rel=1e-6)


def test_shadows_are_priced_by_their_voxels() -> None:
    def priced(**shadow: Any) -> Any:
        rock = {"name": "rock", "source": "rock.glb", "shadow": shadow}
        assets = plan.build(made(ground={}, meshes=[rock])).assets
        (found,) = [asset for asset in assets if asset.name == "occlusion/rock"]
        return found

    assert priced().bytes == 32**3 * 16
    assert priced(grid=16).bytes == 16**3 * 16
    assert priced(components=17).bytes == 32**3 * 20
    assert priced(rays=4096).seconds > priced().seconds


def test_domes_are_priced() -> None:
    def priced(source: str = "meshes/oak.glb", **knobs: Any) -> Any:
        sprites = {**RAW["billboards"][0], "source": source, **knobs}
        return plan.build(made(billboards=[sprites])).assets[-1]

    ring, dome = priced(), priced(dome={})
    # Four planes of sixteen numbers against three
    assert dome.bytes == pytest.approx(ring.bytes * 4 / 3, rel=1e-6)
    assert priced(dome={"channels": 8}).bytes == pytest.approx(dome.bytes / 2, rel=1e-6)
    assert priced(dome={"lights": 128}).seconds > dome.seconds > ring.seconds
    # The same rays, then a fit
    assert priced(dome={"lights": 48}).seconds > priced(ring={"lights": 48}).seconds
    photographed = priced("photographs/oak.lp")
    assert (photographed.kind, photographed.bytes) == ("billboard", dome.bytes)


def test_photographs_are_priced_by_their_own_size(
    bowl: Callable[[Path], Path], tmp_path: Path
) -> None:
    bowl(tmp_path / "photographs/bowl")
    sprites = {**RAW["billboards"][0], "source": "photographs/bowl/set.lp"}
    raw = {**RAW, "lights": [], "billboards": [sprites]}
    found = plan.build(scene.from_dict(raw, where="a.toml", root=tmp_path)).assets[-1]
    # Four planes of 12 x 12 texels, a border half as wide again, a third more for mips
    assert found.bytes == int(4 * 12 * 12 * 1.5**2 * 4 * 4 / 3)
    assert found.source == "photographs/bowl/set.lp"


def test_the_lines_of_the_picture_reach_the_decisions() -> None:
    place = FRAME.index("depth_of_field")
    bounds = [plan.build(made(), lines=n).effects[place].bound for n in (540, 1080)]
    assert bounds[1] == pytest.approx(2 * bounds[0], rel=1e-14)


def test_json_holds_the_whole_plan() -> None:
    found = plan.build(made())
    data = json.loads(plan.as_json(found))
    assert data == json.loads(json.dumps(found.as_dict()))
    assert [effect["name"] for effect in data["effects"]] == list(FRAME)


def test_a_forced_effect_without_its_table_is_refused() -> None:
    with pytest.raises(InputError, match=r"force\.sky"):
        plan.build(made(force={"sky": True}))


def test_the_printed_plan_says_what_and_why() -> None:
    text = printed(made())
    for word in (*FRAME, "[ground] lies at 0 m", "no picture.fog", "meshes/oak.glb", "3 sprites"):
        assert word in text
    assert "\x1b" not in text


def test_styles_are_for_terminals(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    assert "\x1b[" in printed(made(), force_terminal=True)
    assert "\x1b" not in printed(made())
