"""How opaque a fin is, GLSL against numpy."""

import numpy as np
import pytest

from maths import silhouette

pytestmark = pytest.mark.gpu


def test_fins_are_as_opaque_as_their_twin_says(glsl, rng):
    n = 4000
    inside = rng.uniform(-3, 8, n)
    parts = {
        "a": inside,
        "b": inside - rng.uniform(0, 5, n),
        "c": np.where(rng.random(n) < 0.5, 0.0, rng.uniform(0, 4, n)),
        "d": rng.uniform(0.5, np.sqrt(0.5), n),
        "e": rng.uniform(0, 1, n),
    }
    inputs = {name: values.astype(np.float32) for name, values in parts.items()}
    found = glsl("silhouette", "fin_alpha(a, b, c, d, e)", inputs)
    wanted = silhouette.fin_alpha(*(inputs[name].astype(np.float64) for name in "abcde"))
    covered = np.clip(0.5 - inputs["a"] / (2 * inputs["d"]), 0, 1)
    # What rounding may count as covered or not is left out; little left to cover magnifies it
    sure = np.abs(inputs["a"] + inputs["d"]) > 1e-5
    left = np.where(covered < 1, np.maximum(1 - covered, 1e-6), 1)
    assert (np.abs(found - wanted)[sure] <= (1e-6 + 4e-7 / left)[sure]).all()
    assert 0.1 < (wanted > 0).mean() < 0.9
