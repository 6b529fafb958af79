"""The conjugate of the unilateral wire energy: printed values, Fenchel–Young, a semidefinite program, and the composite's phases."""

import numpy as np
import pytest

from fenchel.errors import InputError
from fenchel.potentials import unilateral_conjugate, unilateral_energy
from fenchel.potentials.library import wire

I6 = np.array([1.0, 1, 1, 0, 0, 0])


def matrix(t):
    half = np.sqrt(0.5)
    return np.array(
        [[t[0], half * t[5], half * t[4]], [half * t[5], t[1], half * t[3]], [half * t[4], half * t[3], t[2]]]
    )


def mandel(m):
    return np.array([m[0, 0], m[1, 1], m[2, 2], *(np.sqrt(2) * x for x in (m[1, 2], m[0, 2], m[0, 1]))])


def turned(rng, eigenvalues):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return mandel(q @ np.diag(eigenvalues) @ q.T)


@pytest.mark.parametrize(
    ("eigenvalues", "value"),
    [((1, 1, 1), 0.375), ((3, 1, 0.2), 4.26), ((1, 0, 0), 0.5), ((2, 2, 0.1), 3.615), ((1, 0.5, 0.5), 0.25)],
)
def test_printed_values(eigenvalues, value):
    rng = np.random.default_rng(0)
    for order in ((0, 1, 2), (2, 0, 1), (1, 2, 0)):
        plain = [*np.array(eigenvalues, dtype=float)[list(order)], 0.0, 0.0, 0.0]
        assert unilateral_conjugate(plain, 1.0, 0.5) == pytest.approx(value, rel=1e-14)
        assert unilateral_conjugate(turned(rng, eigenvalues), 1.0, 0.5) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("eigenvalues", [(-1, 0, 0), (3, 1, -1e-6), (-1, -1, -1), (1e5, 1e5, -1.0)])
@pytest.mark.parametrize("lam", [0.0, 1.0])
def test_a_compressive_principal_stress_costs_infinity(eigenvalues, lam):
    assert unilateral_conjugate(turned(np.random.default_rng(1), eigenvalues), lam, 0.5) == np.inf


def random_eigenvalues(rng):
    """Simple, repeated, singular and spherical spectra of either sign."""
    found = np.abs(rng.normal(size=3)) * rng.choice([1.0, 1.0, 1.0, 0.05], size=3)
    kind = rng.integers(6)
    if kind == 1:
        found[1] = found[0]
    elif kind == 2:
        found[:] = found[0]
    elif kind == 3:
        found[2] = 0.0
    elif kind == 4:
        found[1:] = 0.0
    return found


@pytest.mark.parametrize("lam", [0.0, 1e-3, 1.0, 50.0])
def test_fenchel_young(lam):
    rng = np.random.default_rng(2)
    mu = 0.7
    stresses = np.array([turned(rng, random_eigenvalues(rng)) for _ in range(400)])
    strains = np.array([turned(rng, random_eigenvalues(rng) * rng.choice([-1, 1], size=3)) for _ in range(400)])
    above = unilateral_conjugate(stresses, lam, mu)[:, None] + unilateral_energy(strains, lam, mu)[None, :]
    pairs = stresses @ strains.T
    assert np.isfinite(above).all()
    assert (above >= pairs - 1e-12 * (1 + np.abs(pairs))).all()
    # equality at σ = ∂ψ(ε), here by the compiled law
    out = wire.compile()(strains, None, lambda_w=lam, mu_w=mu)
    both = unilateral_conjugate(out.stress, lam, mu) + unilateral_energy(strains, lam, mu)
    assert both == pytest.approx((out.stress * strains).sum(axis=1), rel=1e-11, abs=1e-13)


def test_agrees_with_a_semidefinite_program():
    import cvxpy as cp

    rng = np.random.default_rng(3)
    for k in range(24):
        lam, mu = (0.0 if k % 4 == 0 else 10 ** rng.uniform(-1, 1)), 10 ** rng.uniform(-0.5, 0.5)
        stress = turned(rng, random_eigenvalues(rng))
        # sup of σ:ε − ψ(ε); ε = E₊ − N with E₊, N ⪰ 0 bounds ε^≥:ε^≥ by E₊:E₊, and is exact at the spectral parts
        plus, minus = cp.Variable((3, 3), PSD=True), cp.Variable((3, 3), PSD=True)
        energy = lam / 2 * cp.square(cp.pos(cp.trace(plus - minus))) + mu * cp.sum_squares(plus)
        work = cp.trace(matrix(stress) @ (plus - minus))
        # a maximiser with N of the size of σ/μ exists; the bound keeps the solver from the unbounded rest of the set
        problem = cp.Problem(cp.Maximize(work - energy), [cp.trace(minus) <= 20 * np.trace(matrix(stress)) / mu])
        problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-9, tol_gap_rel=1e-9, tol_feas=1e-9)
        assert unilateral_conjugate(stress, lam, mu) == pytest.approx(problem.value, rel=1e-6, abs=1e-7)


@pytest.mark.parametrize(
    ("stress", "lam", "mu"), [([1.0] * 5, 1, 1), ([np.nan] * 6, 1, 1), ([1.0] * 6, -1, 1), ([1.0] * 6, 1, 0)]
)
def test_bad_input_is_refused(stress, lam, mu):
    with pytest.raises(InputError):
        unilateral_conjugate(stress, lam, mu)
