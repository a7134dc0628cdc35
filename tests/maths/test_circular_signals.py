"""Closed forms against adaptive quadrature, folding against sampling."""

import numpy as np
import pytest
from scipy import integrate

from maths.circular_basis import evaluate
from maths.circular_signals import alias_series, lambert_lobe, shadow_arc, tilted_lambert


def by_quadrature(signal, edge, terms):
    """Integrals of an even signal that is 0 beyond `edge`, which lets quad see no corner."""
    return np.array(
        [
            integrate.quad(
                lambda t, k=k: signal(t) * evaluate(t, terms)[k], -edge, edge, epsabs=1e-13
            )[0]
            for k in range(terms)
        ]
    )


# quad's own estimate for these smooth integrands is under 1e-12
@pytest.mark.parametrize("terms", [1, 3, 5, 13])
def test_lambert_lobe(terms: int) -> None:
    truth = by_quadrature(np.cos, np.pi / 2, terms)
    assert np.allclose(lambert_lobe(terms), truth, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("A", "B"), [(0.3, 0.5), (-0.3, 0.5), (0.0, 1.0), (0.6, 0.5), (-0.6, 0.5), (0.2, 0.0)]
)
def test_tilted_lambert(A: float, B: float) -> None:
    edge = np.pi if A >= B else np.arccos(max(-1.0, min(1.0, -A / B)))
    truth = by_quadrature(lambda t: A + B * np.cos(t), edge, 9)
    assert np.allclose(tilted_lambert(A, B, 9), truth, rtol=0, atol=1e-12)


def test_tilted_lambert_of_a_horizontal_normal_is_the_lobe() -> None:
    assert np.allclose(tilted_lambert(0, 1, 11), lambert_lobe(11), rtol=0, atol=1e-15)


def test_tilted_lambert_refuses_negative_amplitude() -> None:
    with pytest.raises(ValueError, match="amplitude"):
        tilted_lambert(0.1, -0.1, 5)


@pytest.mark.parametrize("half_width", [0.0, 0.4, 2.0, np.pi])
def test_shadow_arc(half_width: float) -> None:
    truth = by_quadrature(lambda t: 1.0, half_width, 9)
    assert np.allclose(shadow_arc(half_width, 9), truth, rtol=0, atol=1e-12)


@pytest.mark.parametrize("lights", [5, 6, 8, 11])
@pytest.mark.parametrize("start", [0.0, 0.37])
def test_alias_series_is_what_even_lights_measure(
    lights: int, start: float, rng: np.random.Generator
) -> None:
    Y = rng.normal(size=41)
    t = start + 2 * np.pi * np.arange(lights) / lights
    measured = evaluate(t, 5).T @ (evaluate(t, 41) @ Y) * (2 * np.pi / lights)
    assert np.allclose(alias_series(Y, lights, 5, start), measured, rtol=0, atol=1e-13)


def test_alias_series_of_a_low_band_is_itself(rng: np.random.Generator) -> None:
    Y = rng.normal(size=7)  # harmonics to 3: exact for N >= 3 + 2 + 1
    assert np.allclose(alias_series(Y, 6, 5), Y[:5], rtol=0, atol=1e-15)
    assert np.abs(alias_series(Y, 5, 5) - Y[:5]).max() > 1e-3
