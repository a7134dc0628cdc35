"""Meshes on the card: textures are filtered as linear light, buffers hold what was saved."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from formats.errors import InputError
from maths import colour
from runtime import surfaces
from runtime.frame import Frame

pytestmark = pytest.mark.gpu
DRAW = (
    "#version 330 core\nvoid main() { gl_Position = vec4(4.0 * float(gl_VertexID & 1) - 1.0,"
    " 2.0 * float(gl_VertexID & 2) - 1.0, 0.0, 1.0); }"
)
LOOK = (
    "#version 330 core\nuniform sampler2D t; uniform float level; uniform vec2 at; out vec4 c;"
    "\nvoid main() { c = textureLod(t, at, level); }"
)


@pytest.fixture
def looked(ctx):
    """Return looked(codes, at, level) -> colour (3,) that a shader reads."""
    frame = Frame(ctx, (1, 1))
    player = SimpleNamespace(ctx=ctx, targets=frame)

    def look(codes, at, level=0.0):
        made = surfaces.texture(player, np.asarray(codes, np.float32), "picture")
        made.anisotropy = 1.0
        program = ctx.program(vertex_shader=DRAW, fragment_shader=LOOK)
        program["level"], program["at"] = level, at
        array = ctx.vertex_array(program, [])
        target = frame.target("seen", dtype="f4")
        target.use()
        made.use(0)
        ctx.enable_only(0)
        array.render(vertices=3)
        found = np.frombuffer(frame.texture("seen").read(), np.float32)[:3].copy()
        array.release()
        program.release()
        frame.drop(made)
        return found

    yield look
    frame.release()


CHECKS = np.array([[[0.0] * 3, [1.0] * 3], [[1.0] * 3, [0.0] * 3]])


def test_codes_are_decoded_from_srgb(looked):
    codes = np.full((2, 2, 3), [128, 200, 20]) / 255
    # Drivers may approximate the curve: llvmpipe does, off by 1.0e-3 (measured over all codes)
    np.testing.assert_allclose(
        looked(codes, (0.5, 0.5)), colour.srgb_decode(codes[0, 0]), atol=1.5e-3
    )


def test_levels_are_means_of_linear_light(looked):
    # Black and white average to 1/2 in light, code 188, not to code 128, which is 0.22
    np.testing.assert_allclose(looked(CHECKS, (0.25, 0.25), 1.0), 0.5, atol=4e-3)


def test_between_texels_linear_light_is_blended(looked):
    np.testing.assert_allclose(looked(CHECKS, (0.5, 0.25)), 0.5, atol=1e-2)


def test_row_0_has_v_0_and_pictures_repeat(looked):
    codes = np.zeros((2, 2, 3))
    codes[0, 1] = 1
    assert looked(codes, (0.75, 0.25)).tolist() == [1, 1, 1]
    assert looked(codes, (-3.25, 7.25)).tolist() == [1, 1, 1]
    assert looked(codes, (0.75, 0.75)).tolist() == [0, 0, 0]


def test_a_picture_larger_than_the_card_takes_is_refused(ctx):
    player = SimpleNamespace(ctx=ctx, targets=None)
    wide = np.zeros((1, ctx.info["GL_MAX_TEXTURE_SIZE"] + 1, 3), np.float32)
    with pytest.raises(InputError, match="texture"):
        surfaces.texture(player, wide, "picture")
