"""Cones and scalar terms of the general engine: Moreau's decomposition, Jacobians by differences, roots to forty digits."""

import mpmath
import numpy as np
import pytest

from fenchel.integrators.cone_projection import (
    EXPONENTIAL,
    EXPONENTIAL_DUAL,
    POWER,
    POWER_DUAL,
    SECOND_ORDER,
    SEMIDEFINITE,
    project,
)
from fenchel.integrators.scalar_terms import (
    ENTROPY_TERM,
    EXPONENTIAL_TERM,
    LOGARITHM_TERM,
    POWER_TERM,
    proximal_step,
    scaled_term,
)
from fenchel.potentials.spectral import to_matrix

DUAL = {EXPONENTIAL: EXPONENTIAL_DUAL, EXPONENTIAL_DUAL: EXPONENTIAL, POWER: POWER_DUAL, POWER_DUAL: POWER}
CONES = [(SECOND_ORDER, 4, 0.0), (SEMIDEFINITE, 6, 0.0), (EXPONENTIAL, 3, 0.0), (EXPONENTIAL_DUAL, 3, 0.0)]
CONES += [(kind, 3, alpha) for kind in (POWER, POWER_DUAL) for alpha in (0.5, 1 / 21, 0.95, 1 / 101)]


def projected(kind, alpha, v):
    out, jacobian = np.zeros(v.size), np.zeros((6, 6))
    mark = project(kind, alpha, v, 0, v.size, out, jacobian, np.zeros(60))
    found = jacobian[: v.size, : v.size]
    return out, np.zeros_like(found) if mark == 0 else np.eye(v.size) if mark == 1 else found


def inside(kind, alpha, v, tolerance):
    """Membership of the *dual* of `kind`, to which `project` goes, by definition."""
    if kind == SECOND_ORDER:
        return np.linalg.norm(v[1:]) <= v[0] + tolerance
    if kind == SEMIDEFINITE:
        return np.linalg.eigvalsh(to_matrix(v)).min() >= -tolerance
    x, y, z = v
    # the exponential cone is steep at its edges: the best point within the tolerance counts
    near = np.array([-tolerance, 0.0, tolerance, 2 * tolerance])
    if kind == EXPONENTIAL_DUAL:
        y = np.maximum(y + near, 1e-300)
        return y.max() > 0 and np.min(y * np.exp(np.minimum((x - tolerance) / y, 700))) <= z + tolerance
    if kind == EXPONENTIAL:
        x = np.minimum(x - near, -1e-300)
        return np.min(-x * np.exp(np.minimum((y + tolerance) / x, 700))) <= np.e * z + tolerance
    if kind == POWER:
        x, y = x / alpha, y / (1 - alpha)
    x, y = max(x, 0.0), max(y, 0.0)
    # the cone is steep at its edges: a step of the tolerance in x and y
    return (x + tolerance) ** alpha * (y + tolerance) ** (1 - alpha) >= abs(z) - tolerance


@pytest.mark.parametrize(("kind", "size", "alpha"), CONES)
def test_projection_is_moreaus_and_its_jacobian_the_derivative(kind, size, alpha):
    rng = np.random.default_rng(size + int(1000 * alpha))
    other = DUAL.get(kind, kind)
    worst = []
    for i in range(600):
        v = rng.normal(size=size) * (10.0 ** rng.uniform(-6, 6, size=size) if i % 2 else 1.0)
        scale = np.abs(v).max()
        p, jacobian = projected(kind, alpha, v)
        rest = p - v
        assert inside(kind, alpha, p / scale, 1e-13)
        assert inside(other, alpha, rest / scale, 1e-13)
        assert abs(p @ rest) <= 1e-13 * scale**2
        assert np.abs(projected(kind, alpha, p)[0] - p).max() <= 1e-13 * scale
        assert np.abs(projected(other, alpha, rest)[0] - rest).max() <= 1e-13 * scale
        if i % 2 == 0:
            h = 1e-6
            steps = h * np.eye(size)
            numeric = np.array([projected(kind, alpha, v + s)[0] - projected(kind, alpha, v - s)[0] for s in steps]).T
            worst.append(np.abs(jacobian - numeric / (2 * h)).max())
            assert np.abs(jacobian - jacobian.T).max() <= 1e-12
            assert -1e-12 <= np.linalg.eigvalsh(jacobian).min() <= np.linalg.eigvalsh(jacobian).max() <= 1 + 1e-12
    assert np.quantile(worst, 0.98) <= 2e-9


def root(kind, c, k, v, tau):
    """λ⁺ to forty digits: the s with g′(s) + τ s + v = 0 by Lambert's function or Newton."""
    C, K, V, T = map(mpmath.mpf, (c, k, v, tau))
    if kind == LOGARITHM_TERM:
        return 2 * C * T / (mpmath.sqrt(V * V + 4 * T * C) - V)
    if kind == POWER_TERM:
        x = min((mpmath.log(abs(V)) - mpmath.log(C * K)) / (K - 1), mpmath.log(abs(V) / T))
        for _ in range(60):
            one, two = C * K * mpmath.exp((K - 1) * x), T * mpmath.exp(x)
            x -= (mpmath.log(one + two) - mpmath.log(abs(V))) * (one + two) / ((K - 1) * one + two)
        return mpmath.sign(V) * C * K * mpmath.exp((K - 1) * x)
    log = mpmath.log(C / (K * T * K)) - V / (T * K) if kind == EXPONENTIAL_TERM else mpmath.log(T * K / C) + V / C
    w = log - mpmath.log(log) if log > 500 else mpmath.lambertw(mpmath.exp(log)).real
    for _ in range(80 if log > 500 else 0):
        w = log - mpmath.log(w)
    return -T * K * w if kind == EXPONENTIAL_TERM else V - C * w


@pytest.mark.parametrize("kind", [POWER_TERM, EXPONENTIAL_TERM, ENTROPY_TERM, LOGARITHM_TERM])
def test_proximal_step_is_the_root(kind):
    rng = np.random.default_rng(kind)
    with mpmath.workdps(40):
        for _ in range(150):
            c = 10 ** rng.uniform(-6, 6)
            k = 1 + 10 ** rng.uniform(-2, 3) if kind == POWER_TERM else 10 ** rng.uniform(-3, 3)
            v, tau = rng.normal() * 10 ** rng.uniform(-5, 5), 10 ** rng.uniform(-1, 5)
            w, slope, _ = proximal_step(kind, c, k, v, tau)
            true = float(root(kind, c, k, v, tau))
            scale = abs(true) + abs(v) + (c if kind == ENTROPY_TERM else 0)
            assert abs(w - true) <= 4e-15 * scale
            h = mpmath.mpf(10) ** -12 * (abs(v) + (c if kind == ENTROPY_TERM else 0))
            numeric = (root(kind, c, k, v + h, tau) - root(kind, c, k, v - h, tau)) / (2 * h)
            assert slope == pytest.approx(float(numeric), rel=1e-8, abs=1e-12)


@pytest.mark.parametrize("kind", [POWER_TERM, EXPONENTIAL_TERM, ENTROPY_TERM, LOGARITHM_TERM])
def test_a_scaled_term_is_the_term_at_another_size(kind):
    # with s = size · s', v = size · v': λ⁺ = size · λ'⁺
    size, tau = 37.0, 3.0
    c, k = scaled_term(kind, 2.0, 1.5, size)
    for v in (-4.0, -0.3, 0.7, 5.0):
        large = proximal_step(kind, 2.0, 1.5, v * size, tau)
        small = proximal_step(kind, c, k, v, tau)
        assert small[0] * size == pytest.approx(large[0], rel=1e-12)
        assert small[1] == pytest.approx(large[1], rel=1e-10)
