"""Every law of the library on random states: optimality of the implicit step, its duality gap, and an unpolished conic program.

States (`awkward_states`): half virgin, half strained before by three admissible steps; increments of 1e-12 to 1e+2 yield strains; an eighth
each of exactly and nearly repeated eigenvalues, spherical, spherical up to rounding, zero, strongly dilating, and on edges or corners.
What the answers are is counted as well: at least a tenth of them at the apex, where there is one, and at edges or corners.

Conditions (`step_optimality`, written from the theory alone), each to 1e-10 × yield stress + 100 × machine epsilon × ‖trial stress‖:

    σ = ∂ψ/∂ε and the forces −∂ψ/∂X at the new state;  f ≤ 0;  ΔX ∈ Δt ∂φ*(Y) + N_{f ≤ 0}(Y) as natural maps of direction, dilatancy,
    back strain and principal axes, with the whole subdifferential at apex and edge;  min(Gγ, −f) = 0;  the rate laws of viscous parts.

"Yield stress" is the stress that a law names as its limit: C_0, sigma_y, sigma_t, c, a (half the preconsolidation pressure), W (width of
the cap), sigma_0, tau_y; of laws without one 1e-3 E or 1e-3 mu_w. "Yield strain" is that stress over E. The floor of the energy is that of
a shear at the yield stress, (yield stress)²/4G. Dissipation is compared with the support function (with φ + Δt φ* of viscous laws) to the
tolerance of stress times Σ|ΔX|.

The tangent of all these laws is a generalised derivative of a projection, and so symmetric and between zero and the elastic stiffness, at
apex, edge and kink too.
"""

import numpy as np
import pytest
from awkward_states import EDGED, NAMES, kinds, load, yield_strain
from law_truth import DEV, I6, TRUTHS, matrix, projection, stiffness
from step_optimality import ELASTIC, EPS, PRINCIPAL, Step

from fenchel.potentials.library import ENTRIES

VISCOUS = ("norton", "perzyna", "bingham", "maxwell", "kelvin_voigt")
CONES = ["sand", "sand_k2", "reinforced_sand", "texsol", "texsol_k2", "drucker_prager", "mobilised_friction"]
WITH_APEX = [*CONES, "drucker_prager_cap", "mohr_coulomb", "rankine"]
LAWS = list(ENTRIES)
assert set(TRUTHS) == set(ENTRIES)


def steps(name, rng, n, factor=1.0):
    """(update, what it answered, the step to be judged)."""
    entry = ENTRIES[name]
    update, values, dt = entry.law.compile(), dict(entry.values), factor * entry.worked.dt
    old, eps, heat = load(update, name, values, rng, n, dt)
    out = update(eps, old, dt, **values, **heat)  # a point that fails would raise
    return update, out, Step(name, values, eps, old, out.state, dt, heat.get("T"))


def worst(excess):
    i = int(np.argmax(excess))
    return f"{float(excess[i]):.3g} times the tolerance at point {i} ({NAMES[i % len(NAMES)]})"


def size_of(x):
    return np.abs(x).reshape(len(x), -1).sum(axis=1)


def judge(name, out, step):
    """All conditions at all points."""
    assert (out.status == 0).all()
    for part in (out.stress, out.tangent, out.dissipation, *out.state.values()):
        assert np.isfinite(part).all()
    tolerance = step.tolerance()
    for what, residual in step.residuals(out.stress).items():
        excess = residual / tolerance
        assert (excess <= 1.0).all(), f"{what}: {worst(excess)}"
    bound_tangent(out.tangent, step)
    if name in ELASTIC:
        return
    gap, energy = step.gap()
    # weak duality, to the rounding of the eigenvalues that the checker takes in double precision
    assert (gap >= -1e-13 * (energy + step.floor())).all()
    excess = gap / np.maximum(energy, step.floor()) / 1e-10
    assert (excess <= 1.0).all(), f"gap: {worst(excess)}"
    # a state is known to its last digit, and so is what it moved by
    digits = sum(size_of(x) for x in (step.eps, *step.new.values()))
    moved = sum(size_of(x) for x in step.change().values()) + EPS * digits
    assert (out.dissipation >= -tolerance * moved).all()
    slack = tolerance * moved + (step.trial() + step.unit) * EPS * digits + 1e-14 * energy + 1e-300
    excess = abs(out.dissipation - step.dissipation()) / slack
    assert (excess <= 1.0).all(), f"dissipation: {worst(excess)}"


def bound_tangent(tangent, step):
    """0 ≤ ∂σ/∂ε ≤ stiffness, symmetric."""
    full = stiffness(float(step.lam), float(step.mu))
    if step.truth.wires is not None:
        full = full + stiffness(*step.truth.wires(step.v))
    if step.name == "kelvin_voigt":
        full = full + (2 * step.v.eta * DEV + step.v.zeta * np.outer(I6, I6)) / float(step.dt)
    size = 1e-9 * np.abs(full).max()
    assert np.abs(tangent - tangent.transpose(0, 2, 1)).max() <= size
    assert np.linalg.eigvalsh(tangent).min() >= -size
    assert np.linalg.eigvalsh(full - tangent).min() >= -size


def regions(name, step):
    """Shares of answers at an apex and at an edge or corner, by what the flow and the forces are."""
    if name in PRINCIPAL:
        moved = step.change()["p"] > 0
        values = np.linalg.eigvalsh(matrix(step.forces(step.new)["eps_p"].astype(float)))
        near = np.diff(values, axis=1) <= 1e-9 * float(step.unit)
        return (moved & near.all(axis=1)).mean(), (moved & (near.sum(axis=1) == 1)).mean()
    X = step.change()
    corner = ((X["p"] > 0) & (X["v"] > 0)).mean() if "v" in X else 0.0
    slip = X["eps_p"] - X["eps_p"][:, :3].mean(axis=1, keepdims=True) * np.array([1, 1, 1, 0, 0, 0])
    inside = np.sqrt(2) * np.linalg.norm(slip.astype(float), axis=1) < (1 - 1e-9) * X["p"]
    return inside.mean(), corner


def check(name, n, seed):
    factors = (1.0, 1e-3, 1e3) if name in VISCOUS else (1.0,)
    for k, factor in enumerate(factors):
        _, out, step = steps(name, np.random.default_rng(seed + k), n, factor)
        judge(name, out, step)
    return step


@pytest.mark.parametrize("name", LAWS)
def test_the_answer_is_optimal_and_proves_it(name):
    step = check(name, 2400 if name not in VISCOUS else 800, 1)
    if name in WITH_APEX or name in EDGED:
        apex, edge = regions(name, step)
        assert name not in WITH_APEX or apex >= 0.1, apex
        assert name not in EDGED or edge >= 0.1, edge


@pytest.mark.validate
@pytest.mark.parametrize("name", LAWS)
def test_a_hundred_thousand_answers_are_optimal(name):
    for k in range(5):
        check(name, 20_000 if name not in VISCOUS else 8_000, 100 + 10 * k)


def against_the_reference(name, n, seed):
    """Distance of the forces to those of the conic program, not above what the gap of the program's own answer allows."""
    update, out, step = steps(name, np.random.default_rng(seed), 2 * n, 1.0)
    pick = np.flatnonzero(kinds(len(out.stress)) != NAMES.index("zero"))[:n]
    # a conic solver sees seven digits: states between a hundredth and a hundred yield strains
    rng = np.random.default_rng(seed + 1)
    entry = ENTRIES[name]
    values, dt = dict(entry.values), entry.worked.dt
    size = 10.0 ** rng.uniform(-2.0, 2.0, len(pick)) * yield_strain(name, values)
    eps = np.asarray(step.eps, dtype=float)[pick]
    before = {k: np.asarray(x, dtype=float)[pick] for k, x in step.old.items()}
    start = before[step.plastic]
    reach = np.linalg.norm(eps - start, axis=1)
    eps = start + (eps - start) * (size / np.where(reach > 0, reach, 1.0))[:, None]
    heat = {} if step.temperature is None else {"T": step.temperature[pick]}
    out = update(eps, before, dt, **values, **heat)
    mine = Step(name, values, eps, before, out.state, dt, heat.get("T"))
    found = []
    for i in range(len(pick)):
        old = {k: x[i] for k, x in before.items()}
        warm = heat["T"][i] if heat else None
        found.append(projection(TRUTHS[name], values, old, eps[i], dt, warm)[0])
    forces = {k: np.array([f[k] for f in found], dtype=np.longdouble) for k in found[0]}
    reference = mine.from_forces(forces)
    value, _ = reference.primal()
    inside = reference.admissible(forces)
    gap = np.maximum(value - reference.dual(inside), 0)
    own, energy = mine.gap()
    # constants of the truth are known to double precision: no gap is, beyond that of its terms
    noise = 2e-15 * (energy + mine.floor())
    bound = np.sqrt(2 * gap) + np.sqrt(2 * np.maximum(own, 0)) + np.sqrt(noise)
    apart = mine.distance(mine.forces(mine.new), inside)
    assert (apart <= bound).all(), (float((apart / bound).max()), int(np.argmax(apart / bound)))
    relative = gap / np.maximum(energy, mine.floor())
    assert np.median(relative) <= 1e-6, float(np.median(relative))  # else the bound would say nothing
    return float((apart / bound).max()), float(np.median(relative))


@pytest.mark.parametrize("name", [name for name in LAWS if name not in ELASTIC])
def test_it_agrees_with_the_conic_program_within_the_bound_of_its_gap(name):
    against_the_reference(name, 25, 7)


@pytest.mark.validate
@pytest.mark.parametrize("name", [name for name in LAWS if name not in ELASTIC])
def test_five_hundred_answers_agree_with_the_conic_program(name):
    against_the_reference(name, 500, 8)
