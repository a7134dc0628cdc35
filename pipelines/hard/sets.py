"""Hard cases of photographs under a dome, of pictures, and of maps of the environment."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake.photographs import Photographs
from pipelines.hard.cells import Family, Result, all_of, at_most, either, equal, noted, refused
from pipelines.hard.finite import saved

sets = Family("photographs, pictures, environments")
Array = NDArray[np.float64]


def lights(count: int, lowest: float = 0.2) -> Array:
    """Return unit directions (count, 3), evenly over the dome from z = `lowest` up."""
    n = np.arange(count)
    z = 1 - (1 - lowest) * (n + 0.5) / count
    t, r = n * np.pi * (3 - np.sqrt(5.0)), np.sqrt(1 - z * z)
    return np.stack([r * np.cos(t), r * np.sin(t), z], axis=-1)


def taken(directions: Array, size: tuple[int, int] = (6, 6), **fields: Any) -> Photographs:
    """Photograph a shallow bowl of matt white, under suns of irradiance pi."""
    h, w = size
    x, y = 0.3 * (np.arange(w) + 0.5 - w / 2) / w, 0.3 * (np.arange(h) + 0.5 - h / 2) / h
    normals = np.stack([*np.meshgrid(x, -y), np.ones((h, w))], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    shade = np.maximum(np.einsum("hwc,nc->nhw", normals, directions), 0)
    pictures = np.repeat(shade[..., None], 3, axis=-1).astype(np.float32)
    return Photographs(pictures, np.asarray(directions), "linear", **fields)


def _dome(photographs: Photographs) -> Any:
    from bake import dome

    return dome.fit(photographs, params=dome.Params(bands=4, penalty=0.1))


def _chosen(photographs: Photographs) -> Any:
    from bake import dome

    return dome.fit(photographs, params=dome.Params())


def _ring(photographs: Photographs) -> Any:
    from bake import photograph_ring

    wide = photograph_ring.Params(elevation=0.6, tolerance=0.7)
    return photograph_ring.fit(photographs, params=wide)


STAGES = (
    ("bake.dome", _dome),
    ("bake.dome, knobs chosen", _chosen),
    ("bake.photograph_ring", _ring),
)
PLAIN = lights(24)


def spoilt(spoil: Callable[[NDArray[np.float32]], NDArray[np.float32]]) -> Photographs:
    """Return the set with other pictures."""
    made = taken(PLAIN)
    return replace(made, pictures=spoil(made.pictures.copy()))


def _with(value: float) -> Callable[[NDArray[np.float32]], NDArray[np.float32]]:
    def put(pictures: NDArray[np.float32]) -> NDArray[np.float32]:
        pictures[3, 2, 1, 0] = value
        return pictures

    return put


def _black(pictures: NDArray[np.float32]) -> NDArray[np.float32]:
    pictures[5] = 0
    return pictures


Case = tuple[str, str, str, Callable[[], Photographs]]
CASES: tuple[Case, ...] = (
    ("D1", "2 photographs", "refused", lambda: taken(lights(2))),
    ("D2", "one light, 24 times", "refused", lambda: taken(np.tile(PLAIN[:1], (24, 1)))),
    ("D3", "lights in one plane", "finite", lambda: taken(_arc(24))),
    ("D4", "lights on one side only", "finite", lambda: taken(_side(24))),
    ("D5", "every light twice", "finite", lambda: taken(np.repeat(lights(12), 2, axis=0))),
    ("D6", "a texel that is NaN", "refused", lambda: spoilt(_with(np.nan))),
    ("D7", "a texel at infinity", "refused", lambda: spoilt(_with(np.inf))),
    ("D8", "a texel of 6.5e4 among texels below 1", "finite", lambda: spoilt(_with(6.5e4))),
    ("D9", "a black photograph", "finite", lambda: spoilt(_black)),
    ("D10", "all photographs black", "finite", lambda: spoilt(np.zeros_like)),
    ("D11", "all photographs white", "finite", lambda: spoilt(np.ones_like)),
    ("D12", "values of 1e-30", "finite", lambda: spoilt(lambda p: p * np.float32(1e-30))),
    ("D13", "values of 1e25", "finite or refused", lambda: spoilt(lambda p: p * np.float32(1e25))),
    (
        "D14",
        "directions of length 0",
        "refused",
        lambda: replace(taken(PLAIN), directions=0 * PLAIN),
    ),
    (
        "D15",
        "directions that are NaN",
        "refused",
        lambda: replace(taken(PLAIN), directions=np.nan * PLAIN),
    ),
    (
        "D16",
        "fewer directions than photographs",
        "refused",
        lambda: replace(taken(PLAIN), directions=PLAIN[:20]),
    ),
    ("C18", "photographs of one texel", "finite", lambda: taken(PLAIN, (1, 1))),
    ("C18b", "photographs of one column", "finite", lambda: taken(PLAIN, (9, 1))),
    (
        "C18c",
        "photographs of no texels",
        "refused",
        lambda: replace(taken(PLAIN), pictures=np.zeros((24, 0, 6, 3), np.float32)),
    ),
    (
        "C13",
        "coverage of 0 everywhere",
        "finite or refused",
        lambda: taken(PLAIN, coverage=np.zeros((6, 6), np.float32)),
    ),
    (
        "C13b",
        "coverage over 1",
        "refused",
        lambda: taken(PLAIN, coverage=np.full((6, 6), 1.5, np.float32)),
    ),
)


def _arc(count: int) -> Array:
    t = np.linspace(0.2, np.pi - 0.2, count)
    return np.stack([np.cos(t), 0 * t, np.sin(t)], axis=-1)


def _side(count: int) -> Array:
    d = lights(4 * count)
    return d[d[:, 0] > 0.2][:count]


for _row, _case, _behaviour, _make in CASES:
    sets.row(_row, _case, _behaviour, "every number of the asset is finite, as made and as read")
    for _stage, _run in STAGES:

        def _bakes(make: Any = _make, run: Any = _run, behaviour: str = _behaviour) -> Result:
            def call() -> Result:
                return saved(run(make()), Path(tempfile.gettempdir()))

            return refused(call) if behaviour == "refused" else either(call)

        if not (_row == "C13" and _stage == "bake.dome, knobs chosen"):
            sets.add(_row, _stage, _bakes, slow="knobs" in _stage and _row != "D4")


def _files(folder: Path, text: str, *pictures: NDArray[np.uint8]) -> Path:
    from formats.files import image

    for n, picture in enumerate(pictures):
        image.write(folder / f"{n}.png", picture)
    (folder / "set.lp").write_text(text)
    return folder / "set.lp"


def _loaded(text: str, *pictures: NDArray[np.uint8]) -> Any:
    from bake import photographs

    with tempfile.TemporaryDirectory() as name:
        return photographs.load(_files(Path(name), text, *pictures))


GREY = np.full((4, 5, 3), 90, np.uint8)
TWO = "2\n0.png 0 0 1\n1.png 0.3 0 0.9\n"
sets.row("C17", "photographs of different sizes", "refused, by file", "the file is named")
sets.add("C17", "bake.photographs", lambda: refused(lambda: _loaded(TWO, GREY, GREY[:3]), "1.png"))
sets.row("C16", "16 bits a channel", "read as such", "65,535 is 1; 257 is a 255th")


@sets.cell("C16", "formats.files.image")
def _sixteen() -> Result:
    import io

    import png

    from formats.files import image
    from maths import colour

    codes = np.arange(0, 65536, 4369, dtype=np.uint16).reshape(1, -1).repeat(3, 0).T
    stream = io.BytesIO()
    png.Writer(1, len(codes), bitdepth=16, greyscale=False).write(stream, codes.tolist())
    found = image.decode(stream.getvalue(), "deep.png")[:, 0, 0]
    return at_most(np.abs(found - colour.srgb_decode(codes[:, 0] / 65535)).max(), 2.0**-23)


sets.row("D17", "light positions that are none", "refused, by line", "the line is named")
for _name, _text in (
    ("a count that is not theirs", "3\n0.png 0 0 1\n"),
    ("no count", "0.png 0 0 1\n"),
    ("two numbers", "1\n0.png 0 0\n"),
    ("a word", "1\n0.png 0 x 1\n"),
    ("length 0", "1\n0.png 0 0 0\n"),
    ("NaN", "1\n0.png 0 nan 1\n"),
    ("infinity", "1\n0.png 0 0 inf\n"),
    ("light behind the object", "1\n0.png 0 0.9 -0.5\n"),
    ("no such photograph", "1\nno.png 0 0 1\n"),
    ("nothing", "\n \n"),
    ("count -1", "-1\n0.png 0 0 1\n"),
    ("count 99999999", "99999999\n0.png 0 0 1\n"),
):
    sets.add("D17", _name, lambda t=_text: refused(lambda: _loaded(t, GREY)))
sets.row("D18", "strange lengths, repeats, black, white, grazing lights", "notes", "told by name")
for _words, _text, _second in (
    ("long", "2\n0.png 0 0 90\n1.png 10 0 80\n", GREY),
    ("more than once", "2\n0.png 0 0 1\n0.png 0.1 0 1\n", GREY),
    ("is black", "2\n0.png 0 0 1\n1.png 0.3 0 0.9\n", 0 * GREY),
    ("overexposed", "2\n0.png 0 0 1\n1.png 0.3 0 0.9\n", GREY * 0 + 255),
    ("under 5 degrees", "2\n0.png 0 0 1\n1.png 1 0 0.05\n", GREY),
):
    sets.add(
        "D18", _words, lambda w=_words, t=_text, p=_second: noted(_loaded(t, GREY, p).notes, w)
    )

sets.row("E1", "maps with NaN, infinity or light below 0", "refused", "checked before any work")
sets.row(
    "E2",
    "maps of one texel, one sun of 1e30, all black",
    "finite, the energy stays; refused where it is no map",
    "sum of radiance times solid angle",
)


def _environment(radiance: NDArray[np.float32]) -> Any:
    from bake import environment

    return environment.resample(radiance, params=environment.Params(width=16))


_SKY = np.random.default_rng(1).random((16, 32, 3)).astype(np.float32)
sets.add("E1", "bake.environment: all below 0", lambda: refused(lambda: _environment(-_SKY)))
for _value in (np.nan, np.inf, -np.inf):

    def _broken(value: float = _value) -> Result:
        sky = _SKY.copy()
        sky[4, 5, 1] = value
        return refused(lambda: _environment(sky))

    sets.add("E1", f"bake.environment: {_value}", _broken)
for _name, _map in (
    ("one texel", np.ones((1, 2, 3), np.float32)), ("black", 0 * _SKY), ("not 2 : 1", _SKY[:, :9]),
    ("one column", _SKY[:, :1]), ("1e-30", _SKY * np.float32(1e-30)),
    ("no texels", _SKY[:0]), ("two channels", _SKY[..., :2]),
):  # fmt: skip
    sets.add("E2", f"bake.environment: {_name}", lambda m=_map: either(
        lambda: saved(_environment(m), Path(tempfile.gettempdir()))))  # fmt: skip


@sets.cell("E2", "energy of one sun")
def _energy() -> Result:
    from maths.transforms import latlong_solid_angles

    sky = 1e-3 * _SKY
    sky[5, 7] = 3e4
    small = _environment(sky).radiance
    total = [np.sum(m * latlong_solid_angles(*m.shape[:2])[:, None, None], dtype=np.float64)
             for m in (sky, small)]  # fmt: skip
    return at_most(abs(total[1] / total[0] - 1), 1e-3, "half floats, 11 bits")


sets.row("E3", "a picture all transparent, of one texel, of NaN", "refused or finite", "as drawn")


def _picture(pixels: NDArray[np.float32]) -> Any:
    from bake import picture

    params = picture.Params(width=pixels.shape[1], height=pixels.shape[0])
    return picture.prepare(pixels, params=params)


for _name, _pixels in (
    ("one texel", np.ones((1, 1, 4), np.float32)),
    ("one row", np.ones((1, 9, 4), np.float32)),
    ("transparent", np.zeros((8, 8, 4), np.float32)),
    ("1e30", np.full((8, 8, 4), 1e30, np.float32)),
):
    sets.add("E3", f"bake.picture: {_name}", lambda p=_pixels: either(
        lambda: saved(_picture(p), Path(tempfile.gettempdir()))))  # fmt: skip


@sets.cell("E3", "premultiplied mean of every level")
def _levels() -> Result:
    pixels = np.random.default_rng(3).random((32, 32, 4)).astype(np.float32)
    pixels[..., :3] *= pixels[..., 3:]
    made = _picture(pixels)
    sums = [float(np.asarray(level, np.float64).mean()) for level in made.levels[:3]]
    return all_of(
        at_most(
            max(abs(s / sums[0] - 1) for s in sums), 2e-3, "half floats and tails of the filter"
        ),
        equal(np.isfinite(sums).all(), True),
    )
