"""Baked levels arrive on the card byte for byte, at any size and alignment."""

from __future__ import annotations

import numpy as np
import pytest

from formats.errors import InputError
from runtime import upload

pytestmark = pytest.mark.gpu


def levels_of(rng, size, layers, dtype):
    """Random levels from (width, height) to one texel, unlike any mips of a driver's own."""
    w, h = size
    count = max(w, h).bit_length()
    shapes = [(layers, max(1, h >> n), max(1, w >> n), 4) for n in range(count)]
    if dtype is np.uint8:
        return [rng.integers(0, 256, s, dtype=np.uint8) for s in shapes]
    return [rng.normal(0, 100, s).astype(np.float16) for s in shapes]


@pytest.mark.parametrize("dtype", [np.uint8, np.float16])
@pytest.mark.parametrize("size", [(8, 8), (13, 7), (1, 1), (1, 9), (33, 2)])
def test_every_level_reads_back_as_it_was_baked(ctx, rng, size, dtype):
    levels = levels_of(rng, size, 3, dtype)
    texture = upload.texture_array(ctx, levels)
    for n, level in enumerate(levels):
        np.testing.assert_array_equal(upload.read_level(ctx, texture, n), level)
    texture.release()


def test_an_unfinished_chain_is_complete_for_the_sampler(ctx, rng):
    # Without GL_TEXTURE_MAX_LEVEL an incomplete chain samples as black
    levels = [np.full((1, 8 >> n, 8 >> n, 4), 10 * (n + 1), np.uint8) for n in range(2)]
    texture = upload.texture_array(ctx, levels)
    program = ctx.program(
        vertex_shader="#version 330 core\nvoid main(){gl_Position=vec4(0,0,0,1);}",
        fragment_shader="""#version 330 core
            uniform sampler2DArray t; out vec4 c;
            void main() { c = textureLod(t, vec3(0.5, 0.5, 0.0), 7.0); }""",
    )
    out = ctx.simple_framebuffer((1, 1), dtype="f4")
    out.use()
    ctx.enable_only(ctx.NOTHING)
    texture.use(0)
    ctx.vertex_array(program, []).render(mode=ctx.POINTS, vertices=1)
    assert np.frombuffer(out.read(components=4, dtype="f4"), "f4")[0] == pytest.approx(20 / 255)
    for made in (program, out, texture):
        made.release()


def test_levels_that_do_not_halve_are_refused(ctx):
    levels = [np.zeros((1, 8, 8, 4), np.uint8), np.zeros((1, 5, 4, 4), np.uint8)]
    with pytest.raises(InputError, match=r"leaf: level 1: \(1, 5, 4, 4\)"):
        upload.texture_array(ctx, levels, "leaf")


def test_another_type_is_refused(ctx):
    with pytest.raises(InputError, match="float64"):
        upload.texture_array(ctx, [np.zeros((1, 2, 2, 4))])


def test_non_contiguous_and_read_only_levels_arrive_whole(ctx, rng):
    whole = rng.integers(0, 256, (2, 8, 16, 4), dtype=np.uint8)
    level = whole[:, :, ::2]
    level.flags.writeable = False
    texture = upload.texture_array(ctx, [level])
    np.testing.assert_array_equal(upload.read_level(ctx, texture, 0), level)
    texture.release()
