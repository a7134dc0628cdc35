"""BC7 in mode 6: the layout bit by bit, exact cases, and the error of what is not exact."""

import numpy as np
import pytest

from maths import bc7


def by_the_table(block: bytes) -> np.ndarray:
    """Decode one block as the specification's table reads, bit after bit."""
    bits = int.from_bytes(block, "little")

    def take(count: int) -> int:
        nonlocal bits
        value = bits & ((1 << count) - 1)
        bits >>= count
        return value

    assert take(7) == 1 << 6
    sevens = [[take(7), take(7)] for _ in range(4)]
    last = [take(1), take(1)]
    ends = [[sevens[c][e] << 1 | last[e] for c in range(4)] for e in range(2)]
    weights = [0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64]
    texels = []
    for texel in range(16):
        w = weights[take(3 if texel == 0 else 4)]
        texels.append([((64 - w) * ends[0][c] + w * ends[1][c] + 32) >> 6 for c in range(4)])
    return np.array(texels).reshape(4, 4, 4)


def test_blocks_decode_as_the_table_says() -> None:
    rng = np.random.default_rng(0)
    blocks = rng.integers(0, 256, (50, 16)).astype(np.uint8)
    blocks[:, 0] = blocks[:, 0] & 0x80 | 0x40
    expected = [by_the_table(block.tobytes()) for block in blocks]
    np.testing.assert_array_equal(bc7.decode(blocks), expected)


def test_one_or_two_colours_are_kept() -> None:
    rng = np.random.default_rng(1)
    # Channels of an end share their last bit: colours that are all even or all odd are exact
    ends = 2 * rng.integers(0, 128, (200, 2, 4)) + rng.integers(0, 2, (200, 2, 1))
    pick = rng.integers(0, 2, (200, 16))
    texels = np.take_along_axis(ends, pick[..., None], axis=1).astype(np.uint8)
    texels = texels.reshape(200, 4, 4, 4)
    np.testing.assert_array_equal(bc7.decode(bc7.encode(texels)), texels)
    single = rng.integers(0, 256, (200, 1, 1, 4)).astype(np.uint8).repeat(4, 1).repeat(4, 2)
    error = bc7.decode(bc7.encode(single)).astype(int) - single
    assert np.abs(error).max() == 1


def test_texels_on_a_line_lose_a_step_at_most() -> None:
    rng = np.random.default_rng(2)
    ends = rng.integers(0, 256, (300, 2, 4)).astype(float)
    share = rng.uniform(size=(300, 16, 1))
    texels = np.rint(ends[:, :1] + share * (ends[:, 1:] - ends[:, :1])).astype(np.uint8)
    found = bc7.decode(bc7.encode(texels.reshape(300, 4, 4, 4))).reshape(300, 16, 4)
    error = found.astype(float) - texels
    span = np.abs(ends[:, 1] - ends[:, 0]).max(axis=1)
    # Half of the largest step, 5/64, and rounding of both ends and of what lies between
    worst = 2.5 / 64 * span + 2.5
    assert np.all(np.abs(error).max(axis=(1, 2)) <= worst)
    assert np.sqrt(np.mean(error**2)) < 2.0


def test_noise_is_nearly_as_good_as_the_best_line() -> None:
    rng = np.random.default_rng(3)
    texels = rng.integers(60, 200, (200, 16, 4)).astype(np.uint8)
    found = bc7.decode(bc7.encode(texels.reshape(-1, 4, 4, 4))).reshape(texels.shape)
    error = np.square(found.astype(float) - texels).sum(axis=(1, 2))
    centred = texels - texels.mean(axis=1, keepdims=True)
    left = np.linalg.svd(centred, compute_uv=False)[:, 1:] ** 2
    # No line leaves less than the principal one, but for 64 numbers rounded by a half at most;
    # over many blocks steps add what rounding takes: .9996, measured
    assert np.all(np.sqrt(error) >= np.sqrt(left.sum(axis=1)) - np.sqrt(64 * 0.25))
    assert error.sum() < 1.01 * left.sum()


def test_volumes_of_any_size_come_back() -> None:
    z, y, x = np.meshgrid(*(np.linspace(0, 1, n) for n in (3, 6, 9)), indexing="ij")
    smooth = np.stack([x, y, z, (x + y) / 2], axis=-1)
    volume = np.rint(40 + 60 * smooth).astype(np.uint8)
    blocks = bc7.encode_volume(volume)
    assert blocks.shape == (3, 2, 3, 16)
    found = bc7.decode_volume(blocks, 6, 9)
    assert found.shape == volume.shape
    # A plane of x and y is no line: a tenth of a block's range
    assert np.abs(found.astype(int) - volume).max() < 20
    assert np.sqrt(np.mean((found.astype(float) - volume) ** 2)) < 8
    # Slices are blocks of their own
    np.testing.assert_array_equal(bc7.encode_volume(volume[1:2])[0], blocks[1])


def test_other_modes_are_refused() -> None:
    with pytest.raises(ValueError, match="mode 6"):
        bc7.decode(np.full((1, 16), 0x01, np.uint8))
    assert bc7.encode(np.zeros((0, 4, 4, 4), np.uint8)).shape == (0, 16)
