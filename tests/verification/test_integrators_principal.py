"""Laws in principal values, against semidefinite programs by hand, identities that need no solver, and differences.

The surfaces are those of the textbooks, with principal stresses σ_1 ≥ σ_2 ≥ σ_3, tension positive: Tresca σ_1 − σ_3 ≤ σ_y, Rankine
σ_1 ≤ σ_t, Mohr–Coulomb (1 + sin φ) σ_1 − (1 − sin φ) σ_3 ≤ 2 c cos φ.
"""

import numpy as np
import pytest
from sympy import sin

from fenchel.integrators import build_update
from fenchel.potentials import (
    Law,
    eig_max,
    eig_min,
    forces,
    indicator,
    inner,
    isotropic,
    norm,
    parameters,
    pos,
    scalar,
    sym_tensor,
    tr,
)
from fenchel.potentials.library import LAWS

E_0, NU = 12e6, 0.25
K, G = E_0 / 3 / (1 - 2 * NU), E_0 / 2 / (1 + NU)
I6 = np.array([1.0, 1, 1, 0, 0, 0])
C_EL = 2 * G * (np.eye(6) - np.outer(I6, I6) / 3) + K * np.outer(I6, I6)
VALUES = {
    "tresca": dict(E=E_0, nu=NU, sigma_y=5e3, H_i=4e5),
    "rankine": dict(E=E_0, nu=NU, sigma_t=3e3, H_i=4e5),
    "mohr_coulomb": dict(E=E_0, nu=NU, c=2e3, phi=0.5, H_i=4e5),
}
UNIT = 3e3
ROOT = np.sqrt(2.0)


def matrices(t):
    half = np.asarray(t)[..., 3:] / ROOT
    out = np.empty((*np.shape(t)[:-1], 3, 3))
    out[..., 0, 0], out[..., 1, 1], out[..., 2, 2] = np.moveaxis(np.asarray(t)[..., :3], -1, 0)
    out[..., 1, 2] = out[..., 2, 1] = half[..., 0]
    out[..., 0, 2] = out[..., 2, 0] = half[..., 1]
    out[..., 0, 1] = out[..., 1, 0] = half[..., 2]
    return out


def mandel(m):
    return np.stack(
        [m[..., 0, 0], m[..., 1, 1], m[..., 2, 2], ROOT * m[..., 1, 2], ROOT * m[..., 0, 2], ROOT * m[..., 0, 1]],
        axis=-1,
    )


def principal_strains(rng, count, low, high):
    """Random principal strains in random directions; equal pairs and triples, one spherical tension in six, one zero."""
    size = UNIT / E_0 * 10 ** rng.uniform(low, high, size=(count, 1))
    eigen = rng.normal(size=(count, 3))
    eigen[::6] = 2 + 0.1 * eigen[::6]
    eigen[1::8, 1] = eigen[1::8, 0]
    eigen[2::8] = eigen[2::8, :1]
    q, _ = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    q[3::5] = np.eye(3)
    eps = mandel(np.einsum("nij,nj,nkj->nik", q, size * eigen, q))
    eps[0] = 0.0
    return eps


def surface(name, values, stress, p):
    eigen = np.linalg.eigvalsh(matrices(stress))
    high, low, R = eigen[:, 2], eigen[:, 0], -values["H_i"] * p
    if name == "tresca":
        return high - low + R - values["sigma_y"]
    if name == "rankine":
        return high + R - values["sigma_t"]
    s = np.sin(values["phi"])
    return (1 + s) / 2 * high - (1 - s) / 2 * low + R - values["c"] * np.cos(values["phi"])


@pytest.mark.parametrize("name", VALUES)
@pytest.mark.parametrize("hardening", [4e5, 0.0])
def test_no_state_fails_and_every_answer_is_optimal(name, hardening):
    values = VALUES[name] | {"H_i": hardening}
    law, rng = LAWS[name], np.random.default_rng(3)
    count = 100_000 if hardening and name == "mohr_coulomb" else 10_000
    strains = principal_strains(rng, count, -12, 2)
    update = law.compile()
    assert update.solver == "principal"
    old = {"eps_p": 1e-4 * rng.normal(size=(count, 6)), "p": 1e-4 * np.abs(rng.normal(size=count))}
    for state in (None, old):
        out = update(strains, state, **values)  # a failing point would raise
        assert np.isfinite(out.stress).all() and np.isfinite(out.tangent).all()
        before = state or {"eps_p": np.zeros((count, 6)), "p": np.zeros(count)}
        flow, gamma = out.state["eps_p"] - before["eps_p"], out.state["p"] - before["p"]
        trial = E_0 * (np.abs(strains).max(axis=1) + np.abs(before["eps_p"]).max(axis=1))
        rounding = 100 * 2.3e-16 * trial
        f = surface(name, values, out.stress, out.state["p"])
        assert (f <= 1e-10 * UNIT + rounding).all()
        assert (gamma >= 0).all()
        # the flow is in the normal cone: σ:Δε^p + R Δp is the support function of the domain, limit × Δp
        limit = {"tresca": "sigma_y", "rankine": "sigma_t"}.get(name)
        limit = values[limit] if limit else values["c"] * np.cos(values["phi"])
        power = np.einsum("ij,ij->i", out.stress, flow) - values["H_i"] * out.state["p"] * gamma
        small = 1e-13 * trial * (np.abs(strains).max(axis=1) + np.abs(before["eps_p"]).max(axis=1))
        assert (np.abs(power - limit * gamma) <= 1e-9 * limit * gamma + small).all()
        assert np.allclose(out.dissipation, limit * gamma, rtol=1e-9, atol=small.max())
        eigen = np.linalg.eigvalsh(matrices(flow))
        positive = np.maximum(eigen, 0.0).sum(axis=1)
        trace = flow[:, :3].sum(axis=1)
        slack = 1e-12 * gamma + 1e-15 * (np.abs(strains).max(axis=1) + np.abs(before["eps_p"]).max(axis=1))
        s = {"tresca": 0.0, "rankine": 1.0}.get(name, np.sin(values.get("phi", 0.0)))
        scale = 2.0 if name == "mohr_coulomb" else 1.0  # f is written with halves there
        dilation = {"tresca": 0.0, "rankine": 1.0}.get(name, 2 * s / scale)
        assert (np.abs(trace - dilation * gamma) <= slack).all()
        reach = 1.0 if name != "mohr_coulomb" else (1 + s) / scale
        assert (positive <= reach * gamma + slack).all()


@pytest.mark.parametrize("name", VALUES)
def test_stress_equals_the_semidefinite_program(name):
    import cvxpy as cp

    values = VALUES[name]
    rng = np.random.default_rng(7)
    count = 100
    strains = principal_strains(rng, count, -1, 1)
    out = LAWS[name].compile(tangent=False)(strains, None, **values)
    trial, sigma, top, low, R = (
        cp.Parameter(6),
        cp.Variable((3, 3), symmetric=True),
        cp.Variable(),
        cp.Variable(),
        cp.Variable(),
    )
    vector = cp.hstack(
        [sigma[0, 0], sigma[1, 1], sigma[2, 2], ROOT * sigma[1, 2], ROOT * sigma[0, 2], ROOT * sigma[0, 1]]
    )
    weight = np.linalg.cholesky(np.linalg.inv(C_EL / E_0)).T
    constraints = [top * np.eye(3) - sigma >> 0, sigma - low * np.eye(3) >> 0]
    if name == "tresca":
        constraints.append(top - low + R <= values["sigma_y"] / UNIT)
    elif name == "rankine":
        constraints.append(top + R <= values["sigma_t"] / UNIT)
    else:
        s = np.sin(values["phi"])
        constraints.append((1 + s) * top - (1 - s) * low + 2 * R <= 2 * values["c"] * np.cos(values["phi"]) / UNIT)
    objective = 0.5 * cp.sum_squares(weight @ (vector - trial)) + 0.5 * cp.square(R) * E_0 / values["H_i"]
    problem = cp.Problem(cp.Minimize(objective), constraints)
    errors = []
    for strain, stress in zip(strains, out.stress, strict=True):
        trial.value = C_EL @ strain / UNIT
        problem.solve(solver="CLARABEL", tol_gap_abs=1e-12, tol_gap_rel=1e-12, tol_feas=1e-12)
        errors.append(np.abs(mandel(sigma.value) * UNIT - stress).max() / (UNIT + E_0 * np.abs(strain).max()))
    # clarabel is right to the root of its gap
    assert np.max(errors) <= 2e-5 and np.median(errors) <= 1e-7
    assert (out.dissipation > 0).mean() >= 0.25


@pytest.mark.parametrize("name", VALUES)
def test_tangent_equals_finite_differences(name):
    values, update = VALUES[name], LAWS[name].compile()
    rng = np.random.default_rng(1)
    count = 120
    strains = principal_strains(rng, count, -0.5, 1)
    out = update(strains, None, **values)
    assert np.abs(out.tangent - out.tangent.transpose(0, 2, 1)).max() <= 1e-9 * E_0
    assert np.linalg.eigvalsh(out.tangent).min() >= -1e-9 * E_0
    checked = 0
    for i in range(1, count):
        found = []
        for width in (2e-5 * np.abs(strains[i]).max(), 1e-5 * np.abs(strains[i]).max()):
            points = np.concatenate([strains[i] + width * np.eye(6), strains[i] - width * np.eye(6)])
            stress = update(points, None, **values).stress
            found.append((stress[:6] - stress[6:]).T / (2 * width))
        if np.abs(found[0] - found[1]).max() > 1e-6 * E_0:
            continue  # a kink in between
        assert np.abs(out.tangent[i] - found[1]).max() <= 1e-6 * E_0 + np.abs(found[0] - found[1]).max(), i
        checked += 1
    assert checked >= 0.7 * count


def test_regions_are_all_visited():
    # the apex of Mohr–Coulomb, both edges, the face and the elastic domain, each at least one point in twenty
    values = VALUES["mohr_coulomb"]
    rng = np.random.default_rng(2)
    strains = principal_strains(rng, 3000, 0, 1)
    out = LAWS["mohr_coulomb"].compile(tangent=False)(strains, None, **values)
    eigen = np.linalg.eigvalsh(matrices(out.stress))
    plastic = out.dissipation > 0
    equal_high, equal_low = (np.abs(eigen[:, i + 1] - eigen[:, i]) <= 1e-9 * UNIT for i in (1, 0))
    regions = [~plastic, plastic & ~equal_high & ~equal_low, plastic & equal_high & ~equal_low]
    regions += [plastic & ~equal_high & equal_low, plastic & equal_high & equal_low]
    assert all(r.mean() >= 0.05 for r in regions), [r.mean() for r in regions]


# -- laws of the user -------------------------------------------------------------------------------------------------------------------

E, nu, a, b, c, k, phi, n = parameters("E nu a b c k phi n")
eps, eps_p, alpha, p = sym_tensor("eps"), sym_tensor("eps_p"), sym_tensor("alpha"), scalar("p")
A, chi, R = forces(eps_p, alpha, p, names="A chi R")
ELASTIC = isotropic(E, nu).energy(eps - eps_p)
HARD = c / 2 * inner(alpha, alpha) + a / 2 * p**2
B = A + chi

MINE = {
    "kinematic": (
        ELASTIC + HARD,
        indicator((1 + sin(phi)) * eig_max(B) - (1 - sin(phi)) * eig_min(B) + R - k),
        dict(phi=0.4),
    ),
    # Mohr–Coulomb with a tension cut-off and a pressure limit: three families of faces
    "cut_off": (
        ELASTIC + HARD,
        indicator(
            (1 + sin(phi)) * eig_max(B) - (1 - sin(phi)) * eig_min(B) + R - k, eig_max(B) - b, -tr(B) / 3 - 4 * k
        ),
        dict(phi=0.4, b=1e3),
    ),
    # Tresca with viscosity of power type
    "viscous": (ELASTIC + HARD, pos((eig_max(B) - eig_min(B) + R - k) / k) ** (n + 1) * b, dict(b=1.0, n=3.0)),
    # the norm of the deviator beside an eigenvalue
    "blended": (ELASTIC + HARD, indicator(eig_max(B) + norm(B - tr(B) / 3 * 0 * B) / 2 + R - k), {}),
}


@pytest.mark.parametrize("name", MINE)
def test_declared_laws_equal_the_general_method(name):
    psi, phi_star, extra = MINE[name]
    law = Law(name, psi=psi, phi_star=phi_star, observable=eps, internal=(eps_p, alpha, p))
    numbers = dict(E=E_0, nu=NU, a=4e5, c=6e5, k=UNIT) | extra
    values = {key: v for key, v in numbers.items() if key in {q.name for q in law.parameters}}
    rng = np.random.default_rng(4)
    count = 60
    strains = principal_strains(rng, count, -1, 1)
    old = {
        "eps_p": 1e-4 * rng.normal(size=(count, 6)),
        "alpha": 1e-4 * rng.normal(size=(count, 6)),
        "p": 1e-4 * rng.random(count),
    }
    one = build_update(law, solver="principal")(strains, old, 0.5, **values)
    two = build_update(law, solver="general")(strains, old, 0.5, **values)
    assert np.abs(one.stress - two.stress).max() <= 1e-7 * UNIT + 1e-10 * E_0 * np.abs(strains).max()
    assert np.abs(one.state["p"] - two.state["p"]).max() * E_0 <= 1e-6 * UNIT
    assert (one.dissipation > 0).sum() >= 20
    update = law.compile()
    checked = 0
    for i in range(1, count, 3):
        width = 1e-5 * np.abs(strains[i]).max()
        found = []
        for h in (2 * width, width):
            points = np.concatenate([strains[i] + h * np.eye(6), strains[i] - h * np.eye(6)])
            stress = update(
                points, {key: np.repeat(v[i : i + 1], 12, axis=0) for key, v in old.items()}, 0.5, **values
            ).stress
            found.append((stress[:6] - stress[6:]).T / (2 * h))
        if np.abs(found[0] - found[1]).max() <= 1e-6 * E_0:
            assert np.abs(one.tangent[i] - found[1]).max() <= 2e-6 * E_0, i
            checked += 1
    assert checked >= 10


@pytest.mark.parametrize("name", VALUES)
def test_a_trial_barely_outside_a_surface_far_from_zero_is_projected(name):
    """The overshoot is then rounding beside the stress: f is known to so many digits, and what is left of it has to be, not more."""
    rng = np.random.default_rng(17)
    eps = principal_strains(rng, 3000, 1, 5)
    update = LAWS[name].compile()
    first = update(eps, None, **VALUES[name])
    for exponent in (-15, -12, -9):
        near = eps * (1 + 10.0**exponent * rng.normal(size=eps.shape))
        second = update(near, first.state, **VALUES[name])
        excess = np.abs(second.stress - first.stress).max(axis=1)
        trial = (2 * G + K) * np.abs(eps).max(axis=1)
        assert (excess <= (100 * 10.0**exponent + 1e-13) * trial).all()
