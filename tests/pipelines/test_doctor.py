"""The doctor: every known fault of a file is found with its measure, and nothing in a sound one."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from formats.errors import InputError
from formats.files import exr, glb, image, rgbe
from pipelines import doctor_machine, single
from pipelines.cli import cli, run
from pipelines.diagnosis import Diagnosis, Finding, amount
from pipelines.doctor_files import examine
from pipelines.hard import cells, matrix, shapes
from pipelines.hard.sets import lights

single.add_to(cli)


def found(told: Diagnosis, words: str) -> Finding:
    """Return the one finding that says some words."""
    fitting = [f for f in told.findings if words in f.what]
    assert len(fitting) == 1, told.lines()
    assert fitting[0].bake
    return fitting[0]


def obj(path: Path, vertices: object, faces: object) -> Path:
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, float).tolist()]
    rows += [f"f {a} {b} {c}" for a, b, c in (np.asarray(faces) + 1).tolist()]
    path.write_text("\n".join(rows) + "\n")
    return path


# meshes


def test_a_sound_mesh_is_fine(tmp_path: Path) -> None:
    ball = shapes.ball(12, 24)
    told = examine(obj(tmp_path / "ball.obj", ball.vertices, ball.faces))
    assert told.findings == []
    assert told.verdict == "fine"
    # 24 triangles at each pole, two for each of the 10 x 24 quadrangles
    assert told.facts[0].startswith("528 faces, 266 vertices, 2 x 2 x 2 m")
    assert "one part" in told.facts


def test_faults_of_meshes_are_counted(tmp_path: Path) -> None:
    ball, box = shapes.ball(12, 24), shapes.box()
    holed = examine(obj(tmp_path / "a.obj", box.vertices, box.faces[1:]))
    assert (found(holed, "open edge").measure, found(holed, "open edge").level) == (3, "warning")
    inward = examine(obj(tmp_path / "b.obj", ball.vertices, ball.faces[:, ::-1]))
    assert found(inward, "looks inward").level == "warning"
    twice = examine(obj(tmp_path / "c.obj", box.vertices, np.tile(box.faces, (2, 1))))
    assert found(twice, "twice in the same place").measure == 12
    turned = box.faces.copy()
    turned[4] = turned[4, ::-1]
    # The three edges of a face that was turned over run twice the same way
    odd = examine(obj(tmp_path / "d.obj", box.vertices, turned))
    assert found(odd, "different sides").measure == 3
    fin = np.concatenate([box.faces, [[0, 1, 8]]])
    crowded = examine(obj(tmp_path / "e.obj", [*box.vertices, [5, 0, 0]], fin))
    assert found(crowded, "more than two faces").measure == 1
    far = examine(obj(tmp_path / "f.obj", ball.vertices + 1e5, ball.faces))
    assert found(far, "from the origin").measure == pytest.approx(5e4, rel=1e-3)
    small = examine(obj(tmp_path / "g.obj", ball.vertices * 1e-3, ball.faces))
    assert found(small, "longest side").measure == pytest.approx(2e-3)
    huge = examine(obj(tmp_path / "g2.obj", ball.vertices * 2e6, ball.faces))
    assert found(huge, "it reaches").measure == pytest.approx(2e6)
    flat = examine(obj(tmp_path / "h.obj", box.vertices * [1, 1, 1e-3], box.faces))
    # Of 256 places one may lie so near to a rim that it counts as thick
    assert found(flat, "occlusion volume").measure > 0.98
    line = examine(obj(tmp_path / "i.obj", box.vertices * [1, 1e-3, 1e-3], box.faces))
    # 8 long faces and none of the 4 at the ends
    assert found(line, "needle").measure == 8


def test_what_no_stage_uses_is_named(tmp_path: Path) -> None:
    ball = shapes.ball()
    glass = glb.Material(name="glass", alpha_mode="BLEND")
    part = glb.Primitive(ball.vertices.astype(np.float32), ball.faces, material=glass)
    glb.write(tmp_path / "a.glb", [glb.Node("a", (part,))])
    assert found(examine(tmp_path / "a.glb"), "glass: alphaMode BLEND").bake == "left out"


def test_sheets_may_be_open(tmp_path: Path) -> None:
    leaf = glb.Material(name="leaf", double_sided=True)
    part = glb.Primitive(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]]), material=leaf)
    glb.write(tmp_path / "a.glb", [glb.Node("a", (part,))])
    assert found(examine(tmp_path / "a.glb"), "open edge").level == "note"


# sets and pictures


def taken(folder: Path, directions: np.ndarray, size: int = 6) -> Path:
    for n in range(len(directions)):
        image.write(folder / f"{n}.png", np.full((size, size, 3), 0.5, np.float32))
    lines = [f"{n}.png {x} {y} {z}" for n, (x, y, z) in enumerate(directions.tolist())]
    (folder / "set.lp").write_text("\n".join([str(len(directions)), *lines]))
    return folder / "set.lp"


def test_a_good_set_of_photographs_is_fine(tmp_path: Path) -> None:
    told = examine(taken(tmp_path, lights(40, 0.1)))
    assert told.findings == []
    assert told.facts[0] == "40 lights at 6 to 81 degrees"


def test_faults_of_photographs_are_found(tmp_path: Path) -> None:
    high = taken(tmp_path, lights(8, 0.8))
    image.write(tmp_path / "3.png", np.ones((6, 6, 3), np.float32))
    image.write(tmp_path / "4.png", np.zeros((6, 6, 3), np.float32))
    told = examine(high)
    # From z = .8, at 53 degrees, down to the lowest that counts, 5 degrees
    assert found(told, "answers there are a guess").measure > 45
    assert found(told, "distinct lights").measure == 8
    assert found(told, "within 10 degrees").measure == 0
    assert found(told, "clipped, 3.png by 100%").measure == 1
    assert found(told, "4.png is black")
    image.write(tmp_path / "5.png", np.ones((6, 5, 3), np.float32))
    assert found(examine(high), "5.png is not like").level == "fault"


def test_too_few_lights_and_repeats_are_found(tmp_path: Path) -> None:
    few = np.repeat(lights(4), 2, axis=0)
    few[0] = [1, 0, 0.05]
    told = examine(taken(tmp_path, few))
    assert found(told, "5 distinct lights").level == "fault"
    assert found(told, "in the place of another").measure == 3
    assert found(told, "under 5 degrees").measure == 1


def test_a_map_is_told_from_a_picture(tmp_path: Path) -> None:
    sky = np.full((16, 32, 3), 0.5, np.float32)
    rgbe.write(tmp_path / "a.hdr", sky)
    told = examine(tmp_path / "a.hdr")
    assert (told.kind, told.findings) == ("environment", [])
    rgbe.write(tmp_path / "b.hdr", sky[:, :20])
    assert found(examine(tmp_path / "b.hdr"), "twice as wide").level == "fault"
    sky[3, 4] = 1e5
    exr.write(tmp_path / "c.exr", {"a": sky})
    told = examine(tmp_path / "c.exr")
    assert found(told, "a sun").measure > 0.9
    assert found(told, "over 65504").measure == 3
    exr.write(tmp_path / "d.exr", {"a": sky - 1})
    # All but the one texel of three values
    assert found(examine(tmp_path / "d.exr"), "below 0").measure == pytest.approx(0.5)
    exr.write(tmp_path / "e.exr", {"a": 0 * sky})
    assert found(examine(tmp_path / "e.exr"), "black")


def test_pictures(tmp_path: Path) -> None:
    pixels = np.ones((8, 8, 4), np.float32)
    pixels[:4, :, 3] = 0
    image.write(tmp_path / "a.png", pixels)
    assert found(examine(tmp_path / "a.png"), "colour under no coverage").measure == 0.5
    image.write(tmp_path / "b.png", 0 * pixels)
    assert found(examine(tmp_path / "b.png"), "transparent").level == "fault"
    image.write(tmp_path / "c.png", pixels[..., :3])
    assert found(examine(tmp_path / "c.png"), "no alpha")


def test_cubes_and_textures_and_scenes(assets: Path) -> None:
    root = Path(__file__).resolve().parents[2] / "assets"
    door = examine(root / "voxels" / "door.vox")
    assert door.kind == "voxels"
    assert any("exposed face" in fact for fact in door.facts)
    told = examine(next((assets / "scenes").glob("*.toml")))
    assert told.kind == "scene"
    assert any(fact.startswith("calls for") for fact in told.facts)


# the command


def test_the_command_tells_and_refuses(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    ball = shapes.ball()
    good = obj(tmp_path / "ball.obj", ball.vertices, ball.faces)
    assert run(["doctor", str(good), "--json"]) == 0
    told = json.loads(capfd.readouterr().out)["files"][0]
    assert (told["kind"], told["file"]) == ("mesh", str(good))
    (tmp_path / "bad.exr").write_bytes(b"v/1\x01" + bytes(300))
    bad = ["bad.exr", "no.obj", "odd.zip", "."]
    (tmp_path / "odd.zip").write_bytes(b"PK")
    assert run(["doctor", str(good), *(str(tmp_path / name) for name in bad)]) == 2
    out = capfd.readouterr()
    assert "mesh" in out.out
    lines = out.err.strip().splitlines()
    assert len(lines) == len(bad), out.err
    assert all(line.startswith("bakelight: ") and " -- " in line for line in lines)
    assert "a folder" in lines[-1]


def test_the_machine_is_told_in_words_and_as_json(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    few = tuple(c for c in matrix.cells(slow=False) if c.row.name in ("R1", "C8", "T12", "V6"))
    monkeypatch.setattr(matrix, "cells", lambda *, slow: few)
    assert run(["doctor"]) == 0
    text = capfd.readouterr().out
    for words in ("OpenGL", "embreex", "GB free", "leak meter", "CPU against GPU", "0 failed"):
        assert words in text
    assert run(["doctor", "--json"]) == 0
    told = json.loads(capfd.readouterr().out)
    assert told["machine"]["opengl"]["limits"]["texture side"] >= 1024
    assert all(row["failed"] == 0 for row in told["checks"])
    assert len(told["cells"]) == len(few)


def test_a_failed_check_is_exit_code_3(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    row = next(c for c in matrix.cells() if c.row.name == "C8")
    bad = replace(row, run=lambda: cells.at_most(2, 1, "twice too much"))
    monkeypatch.setattr(matrix, "cells", lambda *, slow: (bad,))
    assert run(["doctor"]) == 3
    assert "FAILED C8" in capfd.readouterr().out


def test_without_opengl_the_rest_is_told(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from formats.errors import MachineError
    from pipelines.hard import card

    def none() -> None:
        raise MachineError("OpenGL", "no context", "none", "apt-get install libegl1")

    few = tuple(c for c in matrix.cells(slow=False) if c.row.name in ("R1", "C8"))
    monkeypatch.setattr(card, "context", none)
    monkeypatch.setattr(matrix, "cells", lambda *, slow: few)
    assert run(["doctor"]) == 3
    text = capfd.readouterr().out
    assert "apt-get install libegl1" in text
    assert "0 failed" in text


def test_small_limits_are_told() -> None:
    told = {"opengl": {"limits": {"texture side": 4096, "layers": 2048}}}
    assert doctor_machine.short(told) == ["texture side 4096, below 8192"]


def test_amounts() -> None:
    assert amount(2, "face", 1000) == "2 faces (0.2%)"


@pytest.mark.parametrize("make", [lambda p: p, lambda p: p / "no.lp"])
def test_what_is_no_file_is_refused(make: Callable[[Path], Path], tmp_path: Path) -> None:
    with pytest.raises(InputError):
        examine(make(tmp_path))
