"""In what order passes hand light on, so that no bounce is left behind.

A mean over all passes would keep the dark of the first ones: with albedo r its error falls only as
passes^-(1 - r). So light is handed on first and averaged afterwards. Since a change, pairs of
passes (one ray along the cosine each) hand on what the last pair alone found: noisy, but n pairs
leave r^n of the error, whatever has been gathered. Once that is below a fraction of the target,
means count, and what is handed on is renewed whenever the passes have doubled. A number of bounces
is kept by building them up one by one, anew with twice the rays each time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

SHARE = 0.125
"""Of the target: what bounces may still lack when means begin to count."""
FINEST = 2e-3
"""Target below which bounces are not waited for: renewed means see to the rest."""
LEAST, MOST = 20, 400
"""Pairs until then: the fading of what was shown before takes that many; albedo .98 takes 300."""
CHAIN = 4
"""Times the pairs until means count, that the latest light is handed on: one state of that chain is
off as a whole, its mean is not."""
AFTER = 8
"""Pairs that count, for each that builds up a bounce."""


@dataclass(frozen=True)
class Pair:
    """Two passes. blend : of this pair in the latest light. counts : whether what surfaces hand on
    is added up. send : what surfaces hand on from now on: nothing new (""), what `glows` reaches
    them, the `latest` light, or the `mean`."""

    blend: float = 1.0
    counts: bool = True
    send: str = ""


def settling(albedo: float, target: float) -> int:
    """Return pairs after a change until means count. albedo : largest that matters."""
    if albedo <= 0:
        return LEAST
    pairs = np.log(SHARE * max(target, FINEST)) / np.log(min(albedo, 0.99))
    return int(np.clip(np.ceil(pairs), LEAST, MOST))


def pairs(bounces: int, settled: int) -> Iterator[Pair]:
    """Yield pairs without end, from a change on. bounces : -1 for all. settled : of `settling`."""
    if bounces == 0:
        while True:
            yield Pair()
    if bounces < 0:
        for _ in range(CHAIN * settled):
            yield Pair(send="latest")
        length = settled
        while True:
            for k in range(length):
                yield Pair(send="mean" if k == length - 1 else "")
            length *= 2
    rays = 1
    yield Pair(counts=False, send="glows")
    while True:
        for _ in range(bounces - 1):
            for k in range(rays):
                last = k == rays - 1
                yield Pair(1 / (k + 1), rays == 1, "latest" if last else "")
        length = AFTER * max(1, bounces - 1) * rays
        for k in range(length):
            yield Pair(send="glows" if k == length - 1 else "")
        rays *= 2
