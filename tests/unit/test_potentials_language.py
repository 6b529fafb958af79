"""The language of a declaration: vectors, roles of symbols, sums with indicators, rewriting of sympy's maxima, numbers of expressions."""

import numpy as np
import pytest
from sympy import Abs, Max, Min, exp, latex, log

from fenchel.errors import DeclarationError
from fenchel.potentials import (
    Law,
    dev,
    eig_max,
    eig_min,
    eig_sum,
    entropy_flux,
    forces,
    frozen,
    gradient,
    identity,
    indicator,
    inner,
    isotropic,
    norm,
    parameters,
    pos,
    rates,
    scalar,
    sym_tensor,
    temperature,
    tr,
    vector,
)
from fenchel.potentials.atoms import ATOMS, atom_of, register
from fenchel.potentials.derivative import partial, variables_of
from fenchel.potentials.evaluate import evaluate

E, nu, a, c, k, n, T0 = parameters("E nu a c k n T0")
eps, eps_p, p, v, w = sym_tensor("eps"), sym_tensor("eps_p"), scalar("p"), vector("v"), vector("w")
T = temperature("T")
A, R = forces(eps_p, p)
RNG = np.random.default_rng(7)
POINT = {
    E: 1.3, nu: 0.2, a: 0.1, c: 0.3, k: 0.7, n: 2.5, T0: 3.0, T: 4.0,
    eps: RNG.normal(size=(5, 6)), eps_p: RNG.normal(size=(5, 6)), p: RNG.random(5) + 0.1,
    v: RNG.normal(size=(5, 3)), w: RNG.normal(size=(5, 3)), A: RNG.normal(size=(5, 6)), R: RNG.normal(size=5),
    frozen(p): 0.4, gradient(T): RNG.normal(size=(5, 3)),
}  # fmt: skip


def difference(expression, variable, h=1e-6):
    """Central differences of an expression by a variable, written without the code under test."""
    x = np.asarray(POINT[variable], dtype=float)

    def at(change):
        return evaluate(expression, POINT | {variable: x + change})

    if variable in (T, p, R):
        return (at(h) - at(-h)) / (2 * h)
    size = x.shape[-1]
    return np.stack([(at(h * np.eye(size)[i]) - at(-h * np.eye(size)[i])) / (2 * h) for i in range(size)], axis=-1)


STRAIN = eps - eps_p - a * (T - T0) * identity
CASES = [
    (inner(v, w) + norm(2 * v - w) ** 3, (v, w)),
    (k / (2 * T) * inner(gradient(T), gradient(T)), (gradient(T), T)),
    (isotropic(E, nu).energy(STRAIN) + c * pos(tr(STRAIN)) ** 2 - k * T * log(T / T0), (eps, eps_p, T)),
    (inner(pos(STRAIN), pos(STRAIN)) + norm(dev(STRAIN)), (eps, T)),
    (eig_max(A) - 0.3 * eig_min(A) + tr(pos(A)), (A,)),
    (eig_sum(lambda x: pos(x) ** 3 + exp(x / 2), eps - eps_p), (eps, eps_p)),
    (Max(norm(dev(A)), Abs(tr(A)), R) + Min(R, -tr(A)), (A, R)),
    (pos(norm(A) + frozen(p) * R - c) ** (n + 1) + exp(R), (A, R)),
    (p ** (n + 1) * k + p * log(p), (p,)),
]


@pytest.mark.parametrize("case", range(len(CASES)))
def test_derivatives_equal_differences(case):
    from fenchel.potentials.extended import scalar_expression

    expression, variables = CASES[case]
    expression = scalar_expression(expression, "test", "")
    for variable in variables:
        found = evaluate(partial(expression, variable), POINT)
        assert np.abs(found - difference(expression, variable)).max() < 1e-7 * (1 + np.abs(found).max())


def test_numbers_at_kinks_are_elements_of_the_subdifferential():
    zero = {A: np.zeros((1, 6)), R: np.zeros(1), n: 1.5, c: 1.0}
    assert not evaluate(partial(norm(dev(A)), A), zero).any()
    assert not evaluate(partial(pos(R) ** (n + 1), R), zero).any()
    assert np.isfinite(evaluate(partial(eig_max(A), A), zero)).all()


def test_vectors_and_tensors_do_not_mix():
    assert (v - v).terms() == {} and str(v + 2 * v - w) == "3*v - w"
    for wrong in (
        lambda: v + eps,
        lambda: eps + v,
        lambda: v + 1,
        lambda: v * v,
        lambda: v * eps,
        lambda: inner(v, eps),
        lambda: tr(v),
        lambda: dev(v),
        lambda: v**2,
        lambda: 1 / v,
        lambda: norm(p),
        lambda: eig_max(v),
    ):
        with pytest.raises(DeclarationError, match="rank mismatch"):
            wrong()


def test_roles():
    assert (A.role, frozen(p).role, rates(eps_p).role, gradient(T).role, entropy_flux(T).role, T.role) == (
        "force", "frozen", "rate", "force", "rate", "state",
    )  # fmt: skip
    assert variables_of(norm(A) + frozen(p) * R) == {A, R}
    assert variables_of(norm(A + eps_p)) == {A, eps_p}
    assert latex(gradient(T)) == r"\nabla T" and str(frozen(p)) == "frozen(p)" and str(rates(p)) == "dp/dt"
    for wrong in (lambda: forces(A), lambda: forces(T), lambda: gradient(p), lambda: frozen(R), lambda: rates()):
        with pytest.raises(DeclarationError):
            wrong()


def test_a_force_function_is_a_sum():
    law = Law(
        "summed",
        psi=isotropic(E, nu).energy(eps - eps_p),
        phi_star=norm(A) ** 2 * k + indicator(tr(A) - c) + indicator(norm(A) - frozen(p) * c),
        observable=eps,
        internal=(eps_p, p),
    )
    assert len(law.surfaces) == 2 and law.viscous == norm(A) ** 2 * k and law.frozen == (p,)
    assert "phi_star = k*norm(A_eps_p)**2" in law.text and law.text.count("\nf = ") == 2


def test_thermal_quantities():
    psi = isotropic(E, nu).energy(STRAIN) - c * T * (log(T / T0) - 1)
    law = Law("warm", psi=psi, phi_star=k / (2 * T) * inner(gradient(T), gradient(T)), observable=eps, internal=eps_p)
    assert law.temperature == T and law.forces == {T: gradient(T)}
    assert np.allclose(evaluate(law.entropy, POINT), -difference(psi, T), rtol=1e-7)


def test_density_makes_the_energy_volumetric():
    law = Law("heavy", psi=isotropic(E, nu).energy(eps) / 2000, observable=eps, density=2000)
    assert law.energy == 2000 * law.psi and "density = 2000" in law.text
    for wrong in (-1, 0, "2000", p):
        with pytest.raises(DeclarationError, match="density"):
            Law("heavy", psi=isotropic(E, nu).energy(eps), observable=eps, density=wrong, internal=(p,))


def test_the_table_of_atoms_refuses_a_second_record_and_names_strangers():
    with pytest.raises(DeclarationError, match="registered already"):
        register(type(atom_of(norm(A)))())
    from sympy import sin

    with pytest.raises(DeclarationError, match="sin"):
        Law("odd", psi=sin(p) + isotropic(E, nu).energy(eps), observable=eps, internal=(p,))
    assert all(atom.word and atom.smoothness in ("smooth", "C1", "continuous") for atom in ATOMS.values())


def test_a_thermal_strain_inside_a_square_counts_for_concavity_in_temperature():
    """½ (ε − aΔT I):K(ε − aΔT I) holds + 9K a² ΔT²/2, convex in T: no sign of ν makes that vanish."""
    psi = isotropic(E, nu).energy(eps - a * (T - T0) * identity) - c * (T * log(T / T0) - T)
    law = Law("warm", psi=psi, observable=eps)
    for poisson in (-0.2, 0.3):
        assert law.check(E=1e9, nu=poisson, a=1e-5, c=2e6, T0=300.0).admissible is not True
    assert law.check(E=1e9, nu=0.3, a=0.0, c=2e6, T0=300.0).admissible is True
