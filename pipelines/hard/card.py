"""Hard cases on the graphics card: twins of shaders, textures, light gathered in cubes, frames."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipelines.hard import cubes, scenes
from pipelines.hard.cells import Family, Result, all_of, at_most, equal, refused

card = Family("the card")


@lru_cache
def context() -> Any:
    """Return one headless context for all cells; MachineError where there is none."""
    from runtime.capture import make_context

    made = make_context()
    made.extra["nowhere"] = made.simple_framebuffer((1, 1))
    return made


def current() -> Any:
    """Return the context, current. Without a surface it has no default framebuffer, and draws
    nowhere without one: whatever other cells left bound or freed, one is bound."""
    ctx = context()
    ctx.__enter__()
    ctx.extra["nowhere"].use()
    return ctx


def evaluated(
    libraries: str, expression: str, inputs: Mapping[str, ArrayLike], parts: int = 1, **defines: Any
) -> NDArray[np.float32]:
    """Run a GLSL expression once a vertex; returns (n,) or (n, parts)."""
    from runtime.shader import compose

    ctx = current()
    declared, content = [], []
    for name, given in inputs.items():
        values = np.ascontiguousarray(given)
        whole, c = values.dtype.kind in "ui", 1 if values.ndim == 1 else values.shape[1]
        kind = "uint" if whole else "float" if c == 1 else f"vec{c}"
        declared.append(f"in {kind} {name};")
        raw = values.astype("u4" if whole else "f4").tobytes()
        content.append((ctx.buffer(raw), f"{c}{'u' if whole else 'f'}", name))
    out = "float" if parts == 1 else f"vec{parts}"
    includes = [f'#include "{library}.glsl"' for library in libraries.split()]
    body = [f"out {out} value;", "void main() {", f"value = {expression};", "}"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "twin.vert"
        path.write_text("\n".join([*includes, *declared, *body]))
        program = ctx.program(vertex_shader=compose(path, defines).text, varyings=["value"])
    n = len(np.asarray(next(iter(inputs.values()))))
    result = ctx.buffer(reserve=4 * parts * n)
    array = ctx.vertex_array(program, [c for c in content if c[2] in program])
    array.transform(result, mode=ctx.POINTS, vertices=n)
    found = np.frombuffer(result.read(), np.float32).reshape(n, parts)
    for made in (array, program, result, *(buffer for buffer, _, _ in content)):
        made.release()
    return found[:, 0] if parts == 1 else found


def relative(found: ArrayLike, truth: ArrayLike, atol: float) -> float:
    """Return the largest error as a share of |truth| + atol."""
    a, b = np.asarray(found, np.float64), np.asarray(truth, np.float64)
    return float(np.max(np.abs(a - b) / (np.abs(b) + atol)))


card.row(
    "R1", "integer hashes and random numbers", "equal in every bit", "same integers on both sides"
)
card.row("R2", "curves of film and sRGB", "twins agree", "drivers' pow and exp: 5e-5")
card.row("R3", "the thin lens", "twins agree", "float32 at the largest circle: 1e-6")
card.row("R4", "noise and grain", "twins agree", "float32")
card.row(
    "R5", "lights without size, touched, edge on", "finite, 0 to pi L", "pi L is the hemisphere"
)
card.row("R6", "BC1 blocks", "decode as the twin does", "integers")


@card.cell("R1", "hashing.glsl", card=True)
def _hashes() -> Result:
    from maths import hashing, texel_sequences

    keys = np.random.default_rng(1).integers(0, 2**32, (4, 4096), dtype=np.uint64).astype(np.uint32)
    names = dict(zip("abcd", keys, strict=True))
    place = keys[:3] >> np.uint32(18)
    inputs = dict(zip("xyzi", (*place, keys[3]), strict=True))
    found = evaluated("texel_sequences", "unit(texel_dither(uvec3(x, y, z)) + quad(i))", inputs, 4)
    words = texel_sequences.texel_dither(place.T) + texel_sequences.quad(keys[3])
    return all_of(
        equal(evaluated("hashing", "uniform01(a, b, c, d)", names), hashing.uniform01(*keys)),
        equal(found, texel_sequences.unit(words)),
    )


@card.cell("R2", "colour.glsl", card=True)
def _curves() -> Result:
    from maths import colour

    rng = np.random.default_rng(2)
    wide = 10 ** rng.uniform(-5, 5, (2048, 3))
    rgb = np.concatenate([rng.uniform(-0.2, 1.5, (2048, 3)), wide]).astype(np.float32)
    names = ("srgb_encode", "srgb_decode", "tonemap_linear", "tonemap_filmic")
    off = [relative(evaluated("colour", f"{n}(rgb)", {"rgb": rgb}, 3), getattr(colour, n)(rgb), 0.1)
           for n in names]  # fmt: skip
    return at_most(max(off), 5e-5)


@card.cell("R3", "optics.glsl", card=True)
def _optics() -> Result:
    from maths import optics

    rng = np.random.default_rng(3)
    d = (10 ** rng.uniform(-2, 4, 4096)).astype(np.float32)
    f = rng.uniform(0.02, 0.2, 4096).astype(np.float32)
    focus = (f + 10 ** rng.uniform(-1, 3, 4096)).astype(np.float32)
    found = evaluated("optics", "circle_of_confusion(d, f, 2.0, o)", {"d": d, "f": f, "o": focus})
    largest = f / 2 * f / (focus - f) * np.maximum(1, focus / np.maximum(d, f))
    return at_most(
        np.max(np.abs(found - optics.circle_of_confusion(d, f, 2.0, focus)) / largest), 1e-6
    )


@card.cell("R4", "noise.glsl", card=True)
def _noise() -> Result:
    from maths import grain, noise

    rng = np.random.default_rng(4)
    p = rng.uniform(-50, 50, (4096, 3)).astype(np.float32)
    x, y, t = rng.integers(0, 4096, (3, 4096), dtype=np.uint32)
    found = evaluated("grain", "grain(x, y, t)", {"x": x, "y": y, "t": t})
    values = evaluated("hashing noise", "value_noise(p, 7u)", {"p": p})
    return all_of(
        at_most(relative(values, noise.value_noise(p, 7), 0.5), 4e-6),
        at_most(relative(found, grain.grain(x, y, t), 1.0), 6e-7),
    )


@card.cell("R5", "lights.glsl", card=True)
def _degenerate() -> Result:
    n = np.random.default_rng(5).normal(size=(64, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    inputs = {"n": n.astype(np.float32), "z": np.zeros((64, 3), np.float32)}
    up, one = "vec3(0.0, 1.0, 0.0)", "vec3(1.0)"
    calls = [
        f"sphere_irradiance(z, n, z, 0.0, {one})",
        f"sphere_irradiance(z, n, z, 1.0, {one})",
        f"sphere_irradiance(z, n, z + {up}, 1.0, {one})",
        f"disc_irradiance(z, n, z, {up}, 1.0, {one}, true)",
        f"disc_irradiance(z, n, z, {up}, 0.0, {one}, true)",
        f"disc_irradiance(z, n, z + vec3(1.0, 0.0, 0.0), {up}, 1.0, {one}, true)",
        f"rectangle_irradiance(z, n, z, vec3(0.0), vec3(0.0), {one}, true)",
        f"rectangle_irradiance(z, n, z + vec3(1.0), vec3(1.0, 0.0, 0.0), {up}, {one}, true)",
    ]
    found = np.stack([evaluated("lights", call, inputs, 3) for call in calls])
    return all_of(
        equal(np.isfinite(found).all(), True),
        at_most(found.max() / np.pi - 1, 1e-4),
        at_most(-found.min(), 0),
    )


@card.cell("R6", "voxel_light.glsl", card=True)
def _blocks() -> Result:
    from maths import bc1

    rng = np.random.default_rng(6)
    blocks = rng.integers(0, 256, (3000, 8)).astype(np.uint8)
    words, (x, y) = blocks.view("<u4"), rng.integers(0, 4, (2, 3000)).astype(np.uint32)
    inputs = {"low": words[:, 0], "high": words[:, 1], "x": x, "y": y}
    call = "bc1_texel(uvec2(low, high), ivec2(int(x), int(y)))"
    found = evaluated("voxel_light", call, inputs, 4, STORAGE=0)
    return equal(np.rint(found * 255), bc1.decode(blocks)[np.arange(3000), y, x])


card.row(
    "T7",
    "compressed volumes, which OpenGL does not take",
    "as 2D blocks, decoded by ours",
    "row R6",
)
card.cells.append(type(card.cells[0])(card.rows["T7"], "voxel_light.glsl", _blocks, card=True))
card.row("T10", "odd widths, one texel, strided levels", "arrive byte for byte", "read back")
card.row("T11", "software and hardware drivers", "the same picture within rounding",
         "twins R1 to R6 hold on any driver")  # fmt: skip
card.row("R7", "levels that do not halve, other types", "refused", "named before upload")


def _levels(size: tuple[int, int], kind: type) -> list[NDArray[Any]]:
    w, h = size
    rng = np.random.default_rng(w)
    shapes = [(3, max(1, h >> n), max(1, w >> n), 4) for n in range(max(w, h).bit_length())]
    if kind is np.uint8:
        return [rng.integers(0, 256, s, dtype=np.uint8) for s in shapes]
    return [rng.normal(0, 100, s).astype(np.float16) for s in shapes]


def _uploaded(levels: list[NDArray[Any]]) -> Result:
    from runtime import upload

    ctx = current()
    texture = upload.texture_array(ctx, levels)
    found = [equal(upload.read_level(ctx, texture, n), level) for n, level in enumerate(levels)]
    texture.release()
    return all_of(*found)


for _size in ((8, 8), (13, 7), (1, 1), (1, 9), (33, 2)):
    for _kind in (np.uint8, np.float16):
        card.add("T10", f"{_size[0]} x {_size[1]} {_kind.__name__}",
                 lambda s=_size, k=_kind: _uploaded(_levels(s, k)), card=True)  # fmt: skip
card.add("T11", "hashing.glsl, colour.glsl", lambda: all_of(_hashes(), _curves()), card=True)
_EIGHT = np.zeros((1, 8, 8, 4), np.uint8)
for _name, _bad in (
    ("levels that do not halve", [_EIGHT, _EIGHT[:, :5]]), ("float64", [_EIGHT.astype(np.float64)]),
    ("two types", [_EIGHT, _EIGHT[:, :4, :4].astype(np.float16)]),
):  # fmt: skip
    card.add("R7", _name, lambda b=_bad: refused(lambda: _uploaded(b)), card=True)


def gathered(world: Any, side: int, passes: int, **knobs: Any) -> NDArray[np.float64]:
    """Return the irradiance on the inner walls of a closed room, gathered on the card."""
    from bake import voxel_faces
    from runtime.gather import Gather, Knobs
    from runtime.shader import Programs
    from runtime.voxel_world import VoxelVolume

    ctx = current()
    faces = voxel_faces.layout(world.cells, texels=2)
    volume = VoxelVolume(ctx, world, storage="rgba8", gaps=False, brightest=0.0)
    environment = knobs.pop("environment", None)
    made = Gather(ctx, Programs(ctx), volume, faces, knobs=Knobs(**knobs), environment=environment)
    made.step(passes)
    found = np.asarray(made.read(), np.float64)[cubes.inside(faces, side)]
    made.release()
    volume.release()
    return found


card.row("V6c", "white furnace on the card", "E / (1 - albedo)", "closed form; 0.005 as converged")
card.row(
    "V3c", "a closed room in a world of radiance 1000", "nothing leaks in", "0 of n, below 3 / n"
)
card.row("V8c", "4096 passes on the card", "the error still falls",
         "sums are 32 bits wide: 16 would freeze at 2048")  # fmt: skip
card.row("V10c", "one glowing cell of 1000 on the card", "no clamp", "linear in its radiance")


@card.cell("V6c", "runtime.gather", card=True)
def _furnace() -> Result:
    light = gathered(cubes.closed(4, 0.8), 4, 4096, bounces=-1, error=0.01, seed=3) / np.pi
    return at_most(abs(light.mean() * (1 - np.float32(0.8).astype(float)) - 1), 0.005)


@card.cell("V3c", "runtime.gather", card=True, slow=True)
def _leaks() -> Result:
    sky = np.full((4, 8, 3), 1000.0, np.float32)
    light = gathered(cubes.closed(3, 0.5, 0.0), 3, 640, environment=sky, error=0.0)
    return equal(light, 0, f"{len(light) * 640} rays")


@card.cell("V8c", "runtime.gather", card=True, slow=True)
def _stall() -> Result:
    world = cubes.closed(1, 0.0)
    off = [np.sqrt(np.mean((gathered(world, 1, n, bounces=0, error=0.0) / np.pi - 1) ** 2))
           for n in (256, 4096)]  # fmt: skip
    # Sixteen times the passes leave a quarter of the noise or less; a mean that stalls leaves all
    return at_most(off[1], 0.5 * off[0], f"{off[0]:.2g} after 256 passes")


@card.cell("V10c", "runtime.gather", card=True)
def _firefly() -> Result:
    def seen(bright: float) -> NDArray[np.float64]:
        world = cubes.closed(4, 0.0)
        cells = world.cells.copy()
        cells[0, 3, 3] = 2
        world = type(world)(cells, *cubes.palette((0.0, 0.0), (0.0, bright)))
        return gathered(world, 4, 64, bounces=0, error=0.0)

    return at_most(
        np.abs(seen(1000.0) - 1e3 * seen(1.0)).max() / seen(1000.0).max(), 2e-3, "half floats"
    )


card.row(
    "R8", "scenes at their limits, drawn", "every pixel finite and at least 0", "no NaN in a frame"
)


def _drawn(text: str) -> Result:
    from formats.files import exr
    from pipelines.bake_scene import bake_scene
    from pipelines.render_scene import render_scene

    with tempfile.TemporaryDirectory() as name:
        root = Path(name) / "root"
        (root / "scenes").mkdir(parents=True)
        path = root / "scenes" / "a.toml"
        path.write_text(text)
        bake_scene(path, root=root, build_folder=root / "build")
        out = root / "a.exr"
        render_scene(path, out, size="64x36", root=root, build_folder=root / "build")
        pixels = np.concatenate([p.ravel() for p in exr.read(out).values()])
    return all_of(equal(np.isfinite(pixels).all(), True), at_most(-pixels.min(), 0))


SCENES: tuple[tuple[str, Callable[[], str]], ...] = (
    ("the base scene", lambda: scenes.BASE),
    ("fog of 1000", lambda: scenes.changed("0.02", "1000")),
    ("a sun of 1e6", lambda: scenes.changed("[3, 3, 3]", "[1e6, 1e6, 1e6]")),
    ("a camera in the ground", lambda: scenes.changed("[0, 1, 6]", "[0, -1, 6]")),
    ("a camera 1e6 m up", lambda: scenes.changed("[0, 1, 6]", "[0, 1e6, 6]")),
    ("f-number tiny", lambda: scenes.changed("2.8", "0.5")),
)
for _name, _text in SCENES:
    card.add("R8", _name, lambda t=_text: _drawn(t()), card=True, slow=_name == "f-number tiny")
