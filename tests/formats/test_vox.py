"""The .vox reader: bytes laid out by hand, damage of every kind, and files from the wild."""

import os
import time
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest

from formats.errors import InputError
from formats.files import vox, vox_chunks, vox_nodes, vox_palette, vox_scene
from formats.files.vox import VoxFile
from tests.formats import vox_bytes as b

FLIPS = 600  # damaged copies; each takes 2 ms


def refusal(data: bytes) -> str:
    with pytest.raises(InputError) as caught:
        vox.decode(data, "a.vox")
    text = str(caught.value)
    assert text.startswith("a.vox: ")
    assert "\n" not in text
    assert caught.value.remedy
    return text


@pytest.mark.parametrize("version", [150, 200])
def test_cells_of_every_model(version: int) -> None:
    first = b.model((3, 2, 4), [(0, 0, 0, 1), (2, 1, 3, 255)])
    second = b.model((1, 1, 1), [(0, 0, 0, 7)])
    file = vox.decode(b.whole(first, second, version=version), "a.vox")
    assert file.version == version
    assert [m.size for m in file.models] == [(3, 2, 4), (1, 1, 1)]
    assert file.models[0].cells.tolist() == [[0, 0, 0, 1], [2, 1, 3, 255]]
    assert file.models[1].cells.tolist() == [[0, 0, 0, 7]]


def test_index_0_is_empty() -> None:
    file = vox.decode(b.whole(b.model((2, 1, 1), [(0, 0, 0, 0), (1, 0, 0, 3)])), "a.vox")
    assert file.models[0].cells.tolist() == [[1, 0, 0, 3]]


def test_unknown_chunks_and_their_children_are_skipped() -> None:
    note = b.chunk("NOTE", b"\xff" * 7, b.chunk("rOBJ", b"abc"))
    file = vox.decode(b.whole(b.chunk("PACK", b.integers(1)), note, b.ONE, note), "a.vox")
    assert len(file.models) == 1


def test_packed_cells_run_along_x_then_y(rng: np.random.Generator) -> None:
    box = rng.integers(0, 3, (4, 3, 2)).astype(np.uint8)
    size = b.integers(2, 3, 4)
    # Without the last bytes, as Teardown writes them
    packer = zlib.compressobj()
    stream = packer.compress(box.tobytes()) + packer.flush(zlib.Z_SYNC_FLUSH)
    data = b.whole(b.chunk("SIZE", size), b.chunk("TDCZ", size + stream))
    (model,) = vox.decode(data, "a.vox").models
    found = np.zeros_like(box)
    for x, y, z, index in model.cells:
        found[z, y, x] = index
    assert np.array_equal(found, box)
    bomb = b.chunk("TDCZ", size + zlib.compress(bytes(1 << 24)))
    assert "packs 25 cells or more" in refusal(b.whole(b.chunk("SIZE", size), bomb))
    short = b.chunk("TDCZ", size + zlib.compress(bytes(23)))
    assert "packs 23" in refusal(b.whole(b.chunk("SIZE", size), short))


def test_palette_is_off_by_one() -> None:
    file = vox.decode(b.whole(b.ONE, b.colours((1, 2, 3), (4, 5, 6))), "a.vox")
    assert file.palette.shape == (256, 4)
    assert file.palette[:4].tolist() == [[0] * 4, [1, 2, 3, 255], [4, 5, 6, 255], [0] * 4]


def test_a_file_without_a_palette_has_the_default() -> None:
    assert np.array_equal(vox.decode(b.whole(b.ONE), "a.vox").palette, vox_palette.default())


def test_reordered_palette_keeps_every_cell_s_colour_and_material() -> None:
    """IMAP: the editor's place i + 1 shows the file's index `map[i]`."""
    order = [*range(1, 256), 0]
    order[0], order[1], order[9] = 10, 1, 2
    cells = [(i, 0, 0, i + 1) for i in range(12)]
    shades = [(i, i // 2, 255 - i) for i in range(1, 256)]
    parts = [b.model((12, 1, 1), cells), b.colours(*shades)]
    parts.append(b.material(10, _type="_emit", _emit="0.5"))
    plain = vox.decode(b.whole(*parts), "a.vox")
    mapped = vox.decode(b.whole(*parts, b.chunk("IMAP", bytes(order))), "a.vox")
    before, after = plain.models[0].cells[:, 3], mapped.models[0].cells[:, 3]
    assert before.tolist() == list(range(1, 13))
    assert after.tolist() == [2, 10, 3, 4, 5, 6, 7, 8, 9, 1, 11, 12]
    assert np.array_equal(mapped.palette[after], plain.palette[before])
    assert [plain.materials[i].emission for i in before] == [
        mapped.materials[i].emission for i in after
    ]
    assert mapped.materials[1].emission == 0.5
    assert mapped.notes == ()


def test_a_palette_order_that_is_none_is_left_out_with_a_note() -> None:
    file = vox.decode(b.whole(b.ONE, b.chunk("IMAP", bytes(256))), "a.vox")
    assert file.models[0].cells.tolist() == [[0, 0, 0, 1]]
    assert "IMAP" in file.notes[0]


def test_first_frame_of_an_animation() -> None:
    frames = [b.table(_f="8", _t="9 9 9"), b.table(_f="2", _t="1 2 3"), b.table(_f="5")]
    node = b.integers(1) + b.table() + b.integers(2)
    models = b.integers(1) + b.table(_f="4") + b.integers(0) + b.table(_f="3")
    parts = [b.ONE, b.ONE, b.transform(0, 1, frames, _name="it"), b.chunk("nSHP", node + models)]
    nodes = vox.decode(b.whole(*parts), "a.vox").nodes
    assert nodes[0] == vox_nodes.Transform(1, translation=(1, 2, 3), frames=3, name="it")
    assert nodes[1] == vox_nodes.Shape(0, 2)


def test_layers_and_nodes_are_hidden() -> None:
    layers = b.chunk("LAYR", b.integers(3) + b.table(_hidden="1") + b.integers(-1))
    layers += b.chunk("LAYR", b.integers(4) + b.table(_name="a", _hidden="0") + b.integers(-1))
    parts = [b.ONE, b.transform(0, 1, _hidden="1"), b.group(1, 2, _hidden="1"), b.shape(2, 0)]
    file = vox.decode(b.whole(*parts, layers), "a.vox")
    assert file.hidden_layers == {3}
    assert [file.nodes[i].hidden for i in range(3)] == [True, True, False]


REFUSED = {
    "nothing": b"VOX ",
    "not the format": b"DOOD" + b.whole(b.ONE)[4:],
    "another version": b.whole(b.ONE, version=151),
    "no MAIN": b"VOX " + b.integers(150) + b.ONE,
    "no model": b.whole(b.colours((1, 2, 3))),
    "cells without a size": b.whole(b.ONE[24:]),
    "a size of nothing": b.whole(b.model((0, 1, 1), [])),
    "a side of 257": b.whole(b.model((257, 1, 1), [])),
    "a cell outside": b.whole(b.model((2, 2, 2), [(0, 2, 0, 1)])),
    "cells cut off": b.whole(
        b.chunk("SIZE", b.integers(1, 1, 1)), b.chunk("XYZI", b.integers(2, 0))
    ),
    "cells of a negative number": b.whole(
        b.chunk("SIZE", b.integers(1, 1, 1)), b.chunk("XYZI", b.integers(-1))
    ),
    "a palette of 257": b.whole(b.ONE, b.chunk("RGBA", bytes(257 * 4))),
    "no palette in RGBA": b.whole(b.ONE, b.chunk("RGBA")),
    "half a colour": b.whole(b.ONE, b.chunk("RGBA", bytes(1022))),
    "two nodes of one number": b.whole(b.ONE, b.shape(0, 0), b.shape(0, 0)),
    "a rotation twice along an axis": b.whole(b.ONE, b.transform(0, 1, [b.table(_r="5")])),
    "a rotation along a fourth axis": b.whole(b.ONE, b.transform(0, 1, [b.table(_r="3")])),
    "a rotation of nine bits": b.whole(b.ONE, b.transform(0, 1, [b.table(_r="260")])),
    "a translation of two": b.whole(b.ONE, b.transform(0, 1, [b.table(_t="1 2")])),
    "a translation of words": b.whole(b.ONE, b.transform(0, 1, [b.table(_t="1 2 x")])),
    "a translation of far": b.whole(b.ONE, b.transform(0, 1, [b.table(_t="0 0 99999999999")])),
    "a table of less than nothing": b.whole(b.ONE, b.chunk("MATL", b.integers(1, -1))),
    "a table of 2 billion": b.whole(b.ONE, b.chunk("MATL", b.integers(1, 2**31 - 1))),
    "a material of 257": b.whole(b.ONE, b.material(257)),
    "an emission that is no number": b.whole(b.ONE, b.material(1, _type="_emit", _emit="nan")),
    "an emission below 0": b.whole(b.ONE, b.material(1, _type="_emit", _emit="-1")),
    "an emission without end": b.whole(b.ONE, b.material(1, _type="_emit", _flux="1e9")),
    "a shape of no model": b.whole(b.ONE, b.shape(0)),
    "frames of a negative number": b.whole(
        b.ONE, b.chunk("nTRN", b.integers(0) + b.table() + b.integers(1, -1, -1, -1))
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_damage_is_refused(name: str) -> None:
    refusal(REFUSED[name])


def sample(rng: np.random.Generator) -> bytes:
    """A file with everything in it."""
    cells = rng.integers(0, 8, (30, 4)).tolist()
    parts = [
        b.chunk("PACK", b.integers(2)),
        b.model((8, 8, 8), cells),
        b.model((8, 8, 9), cells[:9]),
        b.transform(0, 1),
        b.group(1, 2, 4, 6),
        b.transform(2, 3, [b.table(_r="17", _t="4 -5 6")], layer=1, _name="a"),
        b.shape(3, 0),
        b.transform(4, 5, [b.table(_t="0 0 20", _f="0"), b.table(_f="9")]),
        b.shape(5, 1, 0),
        b.transform(6, 3, [b.table(_r="98")]),
        b.chunk("LAYR", b.integers(1) + b.table(_name="x", _hidden="0") + b.integers(-1)),
        b.colours((10, 20, 30), (200, 100, 50)),
        b.chunk("IMAP", bytes([*range(255, 0, -1), 0])),
        b.material(3, _type="_emit", _emit="0.7", _flux="2", _ldr="0.1"),
        b.chunk("MATT", b.integers(4, 3, 0x3F000000, 0x21, 0x3F800000, 0x3F800000)),
        b.chunk("rCAM", b.integers(0) + b.table(_mode="pers")),
    ]
    return b.whole(*parts)


def show(data: bytes) -> bool:
    """Whether a file is read and shown; all but InputError fails."""
    refusal = None
    try:
        file = vox.decode(data, "a.vox")
        vox_scene.flatten(file)
    except InputError as error:
        refusal = error
    if refusal is None:
        sound(file)
        return True
    assert "\n" not in str(refusal)
    assert refusal.remedy
    return False


def sound(file: VoxFile) -> None:
    for model in file.models:
        assert np.all(model.cells[:, :3].astype(int) < model.size)
        assert np.all(model.cells[:, 3] > 0)
    assert all(np.isfinite(m.emission) and m.emission >= 0 for m in file.materials)


def test_every_cut_is_refused(rng: np.random.Generator) -> None:
    data = sample(rng)
    assert show(data)
    for length in range(len(data)):
        refusal(data[:length])


def test_flipped_bytes_give_a_typed_error_or_a_sound_file(rng: np.random.Generator) -> None:
    data = sample(rng)
    # The palette takes a third of the file, and any colour is a colour
    places = [i for i in range(len(data)) if not 0 <= i - data.index(b"RGBA") - 12 < 1024]
    shown = 0
    for _ in range(FLIPS):
        spoilt = bytearray(data)
        for _ in range(int(rng.integers(1, 4))):
            spoilt[places[int(rng.integers(len(places)))]] = int(rng.integers(256))
        shown += show(bytes(spoilt))
    # Both ends are met
    assert 20 < shown < FLIPS - 20


def test_pieces_put_elsewhere_give_a_typed_error_or_a_sound_file(rng: np.random.Generator) -> None:
    data = sample(rng)
    for _ in range(300):
        at, to, length = (int(rng.integers(8, len(data))) for _ in range(3))
        spoilt = data[:to] + data[at : at + length] + data[to:]
        fixed = spoilt[:16] + b.integers(len(spoilt) - 20) + spoilt[20:]
        show(fixed)


def test_huge_numbers_allocate_nothing() -> None:
    """Lists and tables of 2^31 - 1 entries, in a few bytes."""
    most = 2**31 - 1
    tracemalloc.start()
    try:
        for spoilt in (
            b.chunk("SIZE", b.integers(256, 256, 256)) + b.chunk("XYZI", b.integers(most)),
            b.chunk("nGRP", b.integers(0) + b.table() + b.integers(most)),
            b.chunk("nSHP", b.integers(0) + b.table() + b.integers(most)),
            b.chunk("nTRN", b.integers(0) + b.table() + b.integers(1, -1, -1, most)),
            b.chunk("MATL", b.integers(1, most)),
            b.chunk("MATL", b.integers(1, 1, most)),
        ):
            refusal(b.whole(b.ONE, spoilt))
        # A file of some 100 bytes needs well under 1 MB
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


def test_many_chunks_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vox_chunks, "MAX_CHUNKS", 1000)
    assert vox.decode(b.whole(b.ONE, b.chunk("NOTE") * 997), "a.vox").models
    assert "more than 1000 chunks" in refusal(b.whole(b.ONE, b.chunk("NOTE") * 999))


DATA = os.environ.get("BAKELIGHT_DATA")
REAL = sorted((Path(DATA) / "vox").rglob("*.vox")) if DATA else []


@pytest.mark.skipif(not DATA, reason="BAKELIGHT_DATA names no folder of real .vox files")
def test_files_from_the_wild() -> None:
    start, shown = time.perf_counter(), {}
    for path in REAL:
        if path.name == "not_a.vox":
            assert "does not start with VOX" in refusal(path.read_bytes())
            continue
        file = vox.read(path)
        sound(file)
        shown[path.name] = int(np.count_nonzero(vox_scene.flatten(file).cells))
    assert len(shown) == len(REAL) - 1 >= 30
    # A measure of placing: tiles that are turned in 87 ways lie side by side, never in each other
    tiles = vox.read(next(p for p in REAL if p.name == "test_multiple_model_scene.vox"))
    placed = vox_scene.placements(tiles)
    assert shown["test_multiple_model_scene.vox"] == sum(
        len(tiles.models[p.model].cells) for p in placed if not p.hidden
    )
    # Measured: 4 s for all where two other programs run
    assert time.perf_counter() - start < 30
