"""What of a set's texture goes to the card."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from runtime import sprites
from runtime.sprites import boxes, trimmed


class Asset(SimpleNamespace):
    """As much of a billboard as is trimmed; `dataclasses.replace` stands in below."""

    @property
    def size(self) -> tuple[int, int]:
        return self.levels[0].shape[2], self.levels[0].shape[1]


def bordered(at: tuple[int, int]) -> Asset:
    """Coverage of 4x4 texels at a place (x, y) of 64x32, two planes, four levels of maxima."""
    level = np.zeros((2, 32, 64, 4), np.uint8)
    level[:, at[1] : at[1] + 4, at[0] : at[0] + 4] = np.arange(1, 65).reshape(4, 4, 4)
    levels = [level]
    for _ in range(3):
        n, h, w, c = levels[-1].shape
        levels.append(levels[-1].reshape(n, h // 2, 2, w // 2, 2, c).max(axis=(2, 4)))
    return Asset(levels=tuple(levels), planes=2, pivot=(20.0, 24.0))


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    def replace(asset: Asset, **values: Any) -> Asset:
        return Asset(**{**vars(asset), **values})

    monkeypatch.setattr(sprites, "replace", replace)


@pytest.mark.parametrize("at", [(20, 14), (0, 0), (60, 28), (29, 3)])
def test_what_shows_stays_where_it_is_on_every_level(at: tuple[int, int]) -> None:
    asset = bordered(at)
    found = trimmed(asset)
    assert found.size < asset.size
    moved = np.subtract(asset.pivot, found.pivot).astype(int)
    for n, (whole, part) in enumerate(zip(asset.levels, found.levels, strict=True)):
        h, w = part.shape[1:3]
        assert (w, h) == (found.size[0] >> n, found.size[1] >> n)
        x, y = moved >> n
        np.testing.assert_array_equal(part, whole[:, y : y + h, x : x + w])
        assert part.sum() == whole.sum()
    # The filter's texel around it is there too, but where the whole has none either
    before = boxes(asset.levels, 2) * np.tile(asset.size, 2) - np.tile(moved, 2)
    np.testing.assert_allclose(boxes(found.levels, 2) * np.tile(found.size, 2), before, atol=1e-9)


def test_what_is_empty_or_of_other_sizes_stays_as_it_is() -> None:
    empty = bordered((20, 14))
    empty.levels = tuple(0 * level for level in empty.levels)
    assert trimmed(empty) is empty
    odd = bordered((20, 14))
    odd.levels = tuple(level[:, :-1] if n == 0 else level for n, level in enumerate(odd.levels))
    assert trimmed(odd) is odd
