"""The explicit scheme keeps the promise of its error control: closed forms, and the implicit step in the limit of small steps."""

import numpy as np
import pytest

from fenchel.errors import DeclarationError, InputError
from fenchel.integrators.explicit import ExplicitUpdate
from fenchel.potentials import Law, dev, forces, indicator, isotropic, norm, parameters, sym_tensor
from fenchel.potentials.library import kelvin_voigt, sand, von_mises

SAND = dict(E_s=12e6, nu_s=0.2, theta_f=0.3, C_0=2842.0, H_k=944e3, H_i=472e3)
METAL = dict(E=200e9, nu=0.3, H_k=0.0, H_i=2e9, sigma_y=250e6)


def walked(update, path, **values):
    state = update.initial_state(len(path[0]))
    for strain in path:
        out = update(strain, state, **values)
        state = out.state
    return out


def test_radial_path_of_a_metal_is_exact_to_its_tolerance():
    """Pure shear of von Mises: √3 τ = σ_y + H_i p with G γ = τ + √3 G p (isotropic hardening)."""
    gamma = 0.01  # engineering shear γ = 2 ε₁₂
    strain = np.array([[0, 0, 0, 0, 0, gamma / np.sqrt(2)]])
    G = METAL["E"] / 2.6
    p = (np.sqrt(3) * G * gamma - METAL["sigma_y"]) / (3 * G + METAL["H_i"])
    tau = (METAL["sigma_y"] + METAL["H_i"] * p) / np.sqrt(3)
    update = von_mises.compile("3d", solver="explicit")
    assert update.solver == "explicit"
    out = walked(update, [strain], **METAL)
    assert out.stress[0, 5] / np.sqrt(2) == pytest.approx(tau, rel=1e-5)
    assert out.state["p"][0] == pytest.approx(p, rel=1e-5)
    assert out.tangent is None


def test_error_control_keeps_its_promise():
    """A path that turns, leaves the surface and meets it again on another side: the error falls with the tolerance, and implicit Euler
    tends to the same path with its steps."""
    rng = np.random.default_rng(2)
    turns = 2e-3 * rng.normal(size=(4, 5, 6)) - 1e-3 * np.array([1, 1, 1, 0, 0, 0])
    path = [strain[3:] for strain in np.cumsum(0.5 * turns, axis=0)]
    fine = [
        a + (b - a) * k / 1000 for a, b in zip([0 * path[0], *path[:-1]], path, strict=True) for k in range(1, 1001)
    ]
    reference = walked(sand.compile("3d", tangent=False), fine, **SAND).stress
    scale = np.abs(reference).max()
    errors = [
        np.abs(walked(ExplicitUpdate(sand, t), path, **SAND).stress - reference).max() / scale for t in (1e-2, 1e-4)
    ]
    assert errors[0] < 0.1 and errors[1] < 1e-3 and errors[1] < 0.3 * errors[0]


def test_viscous_relaxation_has_its_closed_form():
    """Maxwell shear: ṡ = −(2G/η) s at fixed strain, φ* = ‖dev A‖²/(2η)."""
    E, nu, eta = parameters("E nu eta")
    eps, eps_v = sym_tensor("eps"), sym_tensor("eps_v")
    A = forces(eps_v)
    law = Law(
        "fluid",
        psi=isotropic(E, nu).energy(eps - eps_v),
        phi_star=norm(dev(A)) ** 2 / (2 * eta),
        observable=eps,
        internal=eps_v,
    )
    strain = np.array([[0, 0, 0, 0, 0, 1e-3]])
    update = ExplicitUpdate(law, 1e-8)
    start = update.initial_state(1) | {"eps": strain.copy()}
    out = update(strain, start, dt=2.0, E=2.6, nu=0.3, eta=4.0)
    assert out.stress[0, 5] == pytest.approx(2e-3 * np.exp(-2.0 * 2.0 / 4.0), rel=1e-6)


def test_two_surfaces_at_their_corner():
    """A square elastic domain in two shears, |a| ≤ k and |b| ≤ k as two norms: the corner holds both at k."""
    E, nu, k = parameters("E nu k")
    eps, one, two = sym_tensor("eps"), sym_tensor("one"), sym_tensor("two")
    A, B = forces(one, two)
    law = Law(
        "twice",
        psi=isotropic(E, nu).energy(eps - one) + isotropic(E, nu).energy(eps - two),
        phi_star=indicator(norm(dev(A)) - k, norm(dev(B)) - 2 * k),
        observable=eps,
        internal=(one, two),
    )
    strain = np.array([[0, 0, 0, 1e-2, 0, 0]])
    out = ExplicitUpdate(law, 1e-6)(strain, None, E=1.0, nu=0.3, k=1e-3)
    assert out.stress[0, 3] == pytest.approx(3e-3, rel=1e-4)


def test_what_the_explicit_step_does_not_take():
    with pytest.raises(DeclarationError, match="without a force of the observable"):
        ExplicitUpdate(kelvin_voigt)
    with pytest.raises(InputError, match="tolerance"):
        ExplicitUpdate(sand, 0.0)
    with pytest.raises(InputError, match="lacks 'eps'"):
        ExplicitUpdate(sand)(
            np.zeros(6), {"eps_p": np.zeros((1, 6)), "alpha": np.zeros((1, 6)), "p": np.zeros(1)}, **SAND
        )
