"""Rays through cubes on the card against numpy, for every way to hold the cells."""

import numpy as np
import pytest

from formats.voxels import Voxels
from maths import bc1, texel_sequences
from maths import voxel_traversal as traversal
from runtime.shader import compose
from runtime.voxel_world import STORAGES, VoxelVolume

pytestmark = pytest.mark.gpu
SIZE = (21, 14, 17)


@pytest.fixture
def voxels(rng):
    cells = (rng.random(SIZE[::-1]) < 0.06).astype(np.uint16)
    cells[cells > 0] = rng.integers(1, 4, np.count_nonzero(cells))
    albedo = np.array([[0, 0, 0], [0.5, 0.5, 0.5], [0.2, 0.4, 0.6], [0.1, 0.1, 0.1]], np.float32)
    emission = np.zeros((4, 3), np.float32)
    emission[3] = 4.0
    return Voxels(cells=cells, albedo=albedo, emission=emission)


def rays(rng, solid, count):
    z, y, x = np.nonzero(~solid)
    cell = np.stack([x, y, z], axis=1)[rng.integers(0, len(x), count)]
    direction = rng.normal(size=(count, 3))
    flat = rng.random((count, 3)) < 0.1
    flat[flat.all(axis=1)] = False
    direction[flat] = 0
    origin = (cell + rng.uniform(0.01, 0.99, (count, 3))).astype(np.float32)
    return cell, origin, direction.astype(np.float32)


def run(context, tmp_path, call, volume, inputs, varyings=("a", "b")):
    """Run a traversal once a vertex; returns floats (n, 8)."""
    declared = "\n".join(f"in vec3 {name};" for name in inputs if name != "jitter")
    text = f"""
#include "traverse.glsl"
#include "texel_sequences.glsl"
uniform WORLD world;
uniform usampler3D gaps;
uniform ivec3 size;
in float jitter;
{declared}
out vec4 a;
out vec4 b;
void main() {{
    Hit hit = {call};
    a = vec4(hit.cell, hit.face);
    b = vec4(hit.t, hit.visited, exit_length(size, origin, direction), 0.0);
}}
"""
    # Composed text is cached by name
    path = tmp_path / f"traverse{abs(hash(call))}.vert"
    path.write_text(text)
    program = context.program(
        vertex_shader=compose(path, volume.defines).text, varyings=list(varyings)
    )
    content = []
    for name, values in inputs.items():
        if name in program:
            kind = "1f" if values.ndim == 1 else "3f"
            content.append((context.buffer(values.astype("f4").tobytes()), kind, name))
    for name, value in (("world", 0), ("gaps", 1), ("size", volume.size)):
        if name in program:
            program[name] = value
    volume.world.use(0)
    if volume.gaps is not None:
        volume.gaps.use(1)
    n = len(inputs["origin"])
    result = context.buffer(reserve=32 * n)
    array = context.vertex_array(program, content)
    array.transform(result, mode=context.POINTS, vertices=n)
    found = np.frombuffer(result.read(), np.float32).reshape(n, 8)
    for made in (array, program, result, *(buffer for buffer, _, _ in content)):
        made.release()
    assert context.error == "GL_NO_ERROR"
    return found


def agree(found, expected, most=2):
    """Everything but where two walls are met within a rounding; `most` rays of all."""
    hit = expected.face >= 0
    same = found[:, 3] == expected.face
    same[hit] &= np.all(found[hit, :3] == expected.cell[hit], axis=1)
    # Drivers may join a product and a sum, and so break a tie the other way
    assert np.count_nonzero(~same) <= most
    np.testing.assert_allclose(found[same, 4], expected.t[same], rtol=2e-6, atol=1e-6)
    np.testing.assert_allclose(found[same, 5], expected.visited[same], atol=0)
    assert 0.15 < hit.mean() < 1


@pytest.mark.parametrize("storage", STORAGES)
def test_exact_and_sphere(context, tmp_path, rng, voxels, storage):
    context.__enter__()
    volume = VoxelVolume(context, voxels, storage=storage, gaps=True)
    cell, origin, direction = rays(rng, voxels.solid, 20000)
    inputs = {"cell": cell, "origin": origin, "direction": direction}
    call = "exact(world, size, ivec3(cell), origin, direction)"
    found = run(context, tmp_path, call, volume, inputs)
    agree(found, traversal.exact(voxels.solid, cell, origin, direction))
    length = traversal.exit_length(SIZE, origin, direction)
    np.testing.assert_allclose(found[:, 6], length, rtol=2e-6)
    if storage == STORAGES[0]:
        call = "sphere(gaps, size, ivec3(cell), origin, direction)"
        found = run(context, tmp_path, call, volume, inputs)
        field = traversal.distances(np.pad(voxels.solid, 1, constant_values=True))
        agree(found, traversal.sphere(field[1:-1, 1:-1, 1:-1], cell, origin, direction))
    volume.release()


def test_march(context, tmp_path, rng, voxels):
    context.__enter__()
    volume = VoxelVolume(context, voxels)
    cell, origin, direction = rays(rng, voxels.solid, 20000)
    jitter = rng.random(20000).astype(np.float32)
    inputs = {"cell": cell, "origin": origin, "direction": direction, "jitter": jitter}
    call = "march(world, size, ivec3(cell), origin, direction, 16.0, 12, jitter)"
    found = run(context, tmp_path, call, volume, inputs)
    expected = traversal.march(voxels.solid, cell, origin, direction, 16.0, 12, jitter)
    agree(found, expected, most=10)
    volume.release()


@pytest.mark.parametrize("storage", STORAGES)
def test_light_is_what_the_copy_says(context, tmp_path, rng, voxels, storage):
    """Updated boxes too; drivers may round what lies between endpoints of BC1 their own way."""
    context.__enter__()
    volume = VoxelVolume(context, voxels, storage=storage, gaps=True)
    moved = voxels.cells.copy()
    moved[3:8, 2:9, 5:13] = rng.integers(0, 4, (5, 7, 8))
    volume.set_cells(moved, [((5, 2, 3), (13, 9, 8))])
    z, y, x = np.indices(SIZE[::-1]).reshape(3, -1)
    cell = np.stack([x, y, z], axis=1)
    inputs = {"cell": cell, "origin": cell + 0.5, "direction": np.ones_like(cell)}
    # The struct carries the colour for once
    call = "Hit(ivec3(light_at(world, ivec3(cell)).rgb * 255.0 + 0.5), "
    call += "solid_at(world, ivec3(cell)) ? 1 : 0, 0.0, "
    call += "int(texelFetch(gaps, ivec3(cell) + 1, 0).x))"
    found = run(context, tmp_path, call, volume, inputs)
    texels = volume.texels.reshape(-1, 4)
    assert np.abs(found[:, :3] - texels[:, :3]).max() <= (2 if storage == "bc1_array" else 0)
    np.testing.assert_array_equal(found[:, 3] > 0, moved.ravel() > 0)
    dark = (moved != 3).ravel()
    assert found[dark, :3].max() == 0
    field = traversal.distances(np.pad(moved > 0, 1, constant_values=True))[1:-1, 1:-1, 1:-1]
    np.testing.assert_array_equal(found[:, 5], field.ravel())
    volume.release()


def test_no_ray_leaks_through_walls_of_touching_cells(context, tmp_path, rng):
    """Half the rays run along diagonals, from middles: they meet edges and corners exactly."""
    context.__enter__()
    n, m = 16, 100000
    z, y, x = np.indices((n, n, n))
    wall = (x + y + z == 12).astype(np.uint16)
    volume = VoxelVolume(context, Voxels(wall, np.zeros((2, 3), "f4"), np.zeros((2, 3), "f4")))
    cell = rng.integers(0, 4, (m, 3))
    origin = np.where(rng.random((m, 1)) < 0.5, cell + 0.5, cell + rng.random((m, 3)))
    direction = np.where(rng.random((m, 3)) < 0.5, 1.0, rng.random((m, 3)))
    inputs = {"cell": cell, "origin": origin, "direction": direction}
    call = "exact(world, size, ivec3(cell), origin, direction)"
    assert run(context, tmp_path, call, volume, inputs)[:, 3].min() >= 0
    volume.release()


def test_blocks_decode_as_the_twin_does(glsl, rng):
    """With bc1_index and expand565, of which bc1_texel is made."""
    blocks = rng.integers(0, 256, (3000, 8)).astype(np.uint8)
    words = blocks.view("<u4")
    x, y = rng.integers(0, 4, (2, 3000)).astype(np.uint32)
    call = "bc1_texel(uvec2(low, high), ivec2(int(x), int(y)))"
    inputs = {"low": words[:, 0], "high": words[:, 1], "x": x, "y": y}
    found = glsl("voxel_light", call, inputs, 4, {"STORAGE": 0})
    expected = bc1.decode(blocks)[np.arange(3000), y, x]
    np.testing.assert_array_equal(np.rint(found * 255), expected)


def test_small_pieces(glsl, rng):
    d = rng.normal(size=(500, 3)).astype(np.float32)
    d[::3, 0] = 0
    found = glsl("traverse", "inverse_of(d)", {"d": d}, 3, {"STORAGE": 0})
    expected = np.where(d == 0, 1e30, 1 / np.where(d == 0, 1, d))
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    call = "is_inside(ivec3(c), ivec3(3, 4, 5)) ? 1.0 : 0.0"
    c = rng.integers(-1, 7, (500, 3)).astype(np.float32)
    found = glsl("traverse", call, {"c": c}, 1, {"STORAGE": 0})
    np.testing.assert_array_equal(found > 0, np.all((c >= 0) & (c < (3, 4, 5)), axis=1))


def test_numbers_are_equal_in_every_bit(glsl, rng):
    place = rng.integers(0, 1 << 14, (3, 4000)).astype(np.uint32)
    index = rng.integers(0, 2**32, 4000, dtype=np.uint64).astype(np.uint32)
    inputs = {"x": place[0], "y": place[1], "z": place[2], "i": index}
    call = "unit(texel_dither(uvec3(x, y, z)) + quad(i))"
    found = glsl("texel_sequences", call, inputs, 4)
    words = texel_sequences.texel_dither(place.T) + texel_sequences.quad(index)
    np.testing.assert_array_equal(found, texel_sequences.unit(words))
    call = "unit(uvec4(pair(i), pair(i)))"
    found = glsl("texel_sequences", call, {"i": index}, 4)
    np.testing.assert_array_equal(found[:, :2], texel_sequences.unit(texel_sequences.pair(index)))
