"""Derivatives by parameters, against differences of the step and of whole paths, closed forms, and Euler's theorem on homogeneity."""

from itertools import pairwise

import numpy as np
import pytest
from law_states import derivative, number, random_states

from fenchel.errors import ConvergenceError, DeclarationError, InputError
from fenchel.integrators import build_update, drive_arrays, path_sensitivities
from fenchel.potentials import Law, dev, forces, indicator, inner, isotropic, norm, parameters, scalar, sym_tensor
from fenchel.potentials.library import ENTRIES
from fenchel.potentials.scalars import ScalarVariable
from fenchel.potentials.spectral import decompose

I6 = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
DEV = np.eye(6) - np.outer(I6, I6) / 3
DT = 0.7
CONES = ("drucker_prager", "mobilised_friction", "sand", "sand_k2", "reinforced_sand", "texsol", "texsol_k2")
SMOOTH = ("von_mises", "bingham", "perzyna", "thermo_elasto_plastic", "cam_clay")
REGIONS = {
    **{name: {"elastic", "surface", "apex"} for name in CONES},
    **{name: {"elastic", "surface"} for name in SMOOTH},
    "mohr_coulomb": {"elastic", "surface", "upper edge", "lower edge", "apex"},
    "rankine": {"elastic", "surface", "upper edge", "apex"},
    "tresca": {"elastic", "surface", "upper edge", "lower edge"},
    "drucker_prager_cap": {"elastic", "surface 0", "surface 1", "corner", "apex"},
}


def states(entry, rng, count):
    """Strains and states by name: ordinary, nearly spherical, exactly axisymmetric; small to large."""
    found = []
    for amplitude in (0.05, 0.5, 3.0, 50.0):
        x = random_states(entry, rng, count, amplitude)
        eps = x[entry.law.observable.name]
        third = count // 3
        size = np.abs(eps[:third]).max(axis=1, keepdims=True)
        eps[:third] = rng.choice([-1.0, 1.0], size=(third, 1)) * size * I6 + 0.02 * eps[:third]
        eps[third : third + 3, 3:], eps[third : third + 3, 1] = 0.0, eps[third : third + 3, 0]
        for variable in entry.law.internal:
            x[variable.name][::2] = 0.0
        found.append(x)
    return {name: np.concatenate([x[name] for x in found]) for name in found[0]}


def parts(entry, x):
    """(strain, state by name, temperature keyword)."""
    law = entry.law
    heat = {} if law.temperature is None else {law.temperature.name: x[law.temperature.name]}
    state = {v.name: x[v.name] for v in law.internal}
    if entry.law.name == "kelvin_voigt":
        state[law.observable.name] = 0.4 * x[law.observable.name][::-1]
    return x[law.observable.name], state, heat


def columns(result, j=None):
    """Stress, state and dissipation of a result (or their derivatives by the j-th parameter) as groups of columns, (n, ·) each."""
    take = (lambda a: a) if j is None else (lambda a: a[..., j])
    n = len(result.stress)
    return [take(a).reshape(n, -1) for a in (result.stress, *result.state.values(), result.dissipation)]


def assert_same(mine, differences, coarser, what):
    """Equal to 1e-6 of the largest entry, at points where two spacings agree; those must be nearly all."""
    for found, right, rough in zip(mine, differences, coarser, strict=True):
        size = np.abs(right).max()
        smooth = np.abs(right - rough).max(axis=1) <= 1e-7 * size
        assert smooth.mean() > 0.9, what
        assert np.abs(found - right)[smooth].max() <= 1e-6 * size + 1e-300, what


def assert_derivatives(update, entry, eps, state, heat, rng, given=None):
    """Total derivatives along random directions of the strain and of the old state."""
    values = dict(entry.values) if given is None else given
    law, n = update.law, len(eps)
    names = [p.name for p in law.parameters] + list(heat)
    scale = {name: abs(values[name]) if name in values else 300.0 for name in names}
    strain = rng.normal(size=(n, 6, len(names))) * np.abs(eps).max(axis=1)[:, None, None]
    old = {name: rng.normal(size=(*a.shape, len(names))) * 0.1 * np.abs(a).max() for name, a in state.items()}
    strain, old = ([a / np.array(list(scale.values())) for a in g] for g in ([strain], old.values()))
    strain, old = strain[0], dict(zip(state, old, strict=True))
    found = update.sensitivities(eps, state, DT, wrt=names, d_state=old, d_eps=strain, **values, **heat)
    assert found.names == tuple(names)
    for j, name in enumerate(names):

        def step(t, j=j, name=name):
            moved, warm = dict(values), dict(heat)
            if name in heat:
                warm[name] = heat[name] + t
            else:
                moved[name] = values[name] + t
            before = {k: a + t * old[k][..., j] for k, a in state.items()}
            result = update(eps + t * strain[..., j], before, DT, **moved, **warm)
            return np.hstack(columns(result))

        h = 2e-4 * scale[name]
        cuts = np.cumsum([c.shape[1] for c in columns(found, j)])[:-1]
        fine, coarse = (np.split(derivative(step, 0.0, s), cuts, axis=1) for s in (h, 3 * h))
        assert_same(columns(found, j), fine, coarse, f"{law.name}, {name}")


def regions(update, entry, eps, state, heat, result):
    """Names of the regions that the answers lie in, read off the answers themselves."""
    law = entry.law
    x = {law.observable.name: eps, **{n: a for n, a in result.state.items() if n != law.observable.name}, **heat}
    moved = np.hstack([np.abs(result.state[n] - a).reshape(len(eps), -1) for n, a in state.items()]).max(axis=1)
    names = np.where(moved == 0.0, "elastic", "surface").astype("U16")
    known = {f: number(law.force_laws[v], law, entry.values, x) for v, f in law.forces.items() if v in law.force_laws}
    tensors = [a for a in known.values() if np.ndim(a) == 2]
    base = sum(tensors[1:], tensors[0])
    scale = sum(abs(v) for p, v in entry.values.items() if p in ("E", "E_s")) * np.abs(eps).max(axis=1)
    plastic = moved > 0.0
    if "upper edge" in REGIONS[law.name]:
        b = np.sort(decompose(base)[0], axis=1)[:, ::-1]
        top, low = (np.abs(b[:, i] - b[:, i + 1]) <= 1e-9 * scale for i in (0, 1))
        names[plastic & top], names[plastic & low], names[plastic & top & low] = "upper edge", "lower edge", "apex"
        return names
    if len(law.surfaces) == 2:
        near = [np.abs(number(f, law, entry.values, x, symbols=known)) <= 1e-8 * scale for f in law.surfaces]
        names[plastic & near[0]], names[plastic & near[1]] = "surface 0", "surface 1"
        names[plastic & near[0] & near[1]] = "corner"
    if "apex" in REGIONS[law.name]:
        names[plastic & (np.linalg.norm(base @ DEV, axis=1) <= 1e-9 * scale)] = "apex"
    return names


@pytest.mark.parametrize("name", ENTRIES)
def test_total_derivatives_agree_with_differences_of_the_step_in_every_region(name):
    entry, rng = ENTRIES[name], np.random.default_rng(3)
    update = build_update(entry.law)
    eps, state, heat = parts(entry, states(entry, rng, 15))
    if name in REGIONS:
        found = regions(update, entry, eps, state, heat, update(eps, state, DT, **entry.values, **heat))
        assert set(np.unique(found)) >= REGIONS[name]
    assert_derivatives(update, entry, eps, state, heat, rng)


@pytest.mark.parametrize("name", ENTRIES)
def test_the_tangent_of_the_step_is_the_derivative_by_the_strain_in_every_region(name):
    entry, rng = ENTRIES[name], np.random.default_rng(4)
    update = build_update(entry.law)
    eps, state, heat = parts(entry, states(entry, rng, 15))
    result = update(eps, state, DT, **entry.values, **heat)
    unit = np.zeros((len(eps), 6, 6)) + np.eye(6)
    names = [p.name for p in entry.law.parameters][:1]
    by_column = []
    for i in range(6):
        kwargs = dict(wrt=names, **entry.values, **heat)
        moved = update.sensitivities(eps, state, DT, d_eps=unit[:, :, i : i + 1], **kwargs)
        by_column.append((moved.stress - update.sensitivities(eps, state, DT, **kwargs).stress)[:, :, 0])
    found = np.stack(by_column, axis=2)
    size = np.abs(result.tangent).max(axis=(1, 2)) + np.abs(update.sensitivities(eps, state, DT, **kwargs).stress).max()
    assert (np.abs(found - result.tangent).max(axis=(1, 2)) <= 1e-9 * size).all()


@pytest.mark.parametrize("name", ENTRIES)
def test_scaling_all_stresses_of_a_law_scales_its_stress_and_leaves_its_strains(name):
    # Euler: σ is of degree one in the parameters that hold a stress in their unit, strains of degree zero, dissipation of degree one
    entry, rng = ENTRIES[name], np.random.default_rng(5)
    update = build_update(entry.law)
    eps, state, heat = parts(entry, states(entry, rng, 15))
    stresses = [p.name for p in entry.law.parameters if p.unit.startswith("Pa")]
    assert stresses
    found = update.sensitivities(eps, state, DT, wrt=stresses, **entry.values, **heat)
    result = update(eps, state, DT, **entry.values, **heat)
    theta = np.array([entry.values[s] for s in stresses])
    size = np.abs(found.stress * theta).max(axis=(1, 2)) + 1e-12
    assert (np.abs(found.stress @ theta - result.stress).max(axis=1) <= 1e-10 * size).all()
    assert (
        np.abs(found.dissipation @ theta - result.dissipation).max() <= 1e-10 * np.abs(result.dissipation).max() + 1e-15
    )
    for state_slope in found.state.values():
        assert np.abs(state_slope @ theta).max() <= 1e-10 * np.abs(state_slope * theta).max() + 1e-15


def test_linear_elasticity_is_linear_in_youngs_modulus():
    update = build_update(ENTRIES["linear_elastic"].law)
    eps = np.random.default_rng(0).normal(size=(5, 6))
    found = update.sensitivities(eps, E=3e9, nu=0.3)
    np.testing.assert_allclose(3e9 * found.stress[:, :, 0], update(eps, E=3e9, nu=0.3).stress, rtol=1e-14)
    # λ = Eν/((1+ν)(1−2ν)), μ = E/(2(1+ν))
    by_lambda = 3e9 * (1 + 2 * 0.3**2) / ((1.3) * (1 - 0.6)) ** 2
    right = by_lambda * eps[:, :3].sum(axis=1)[:, None] * I6 - 2 * 3e9 / (2 * 1.3**2) * eps
    np.testing.assert_allclose(found.stress[:, :, 1], right, rtol=1e-12, atol=1e-3)


def test_the_radial_return_of_von_mises_differentiated_by_hand():
    # σ = K tr ε I + (2μ e − √6 μ Δp n), Δp = (√6 μ ‖e‖ − σ_y)/(3μ + H), n = e/‖e‖ from the virgin state, H = H_k + H_i
    values = dict(E=200e9, nu=0.3, sigma_y=250e6, H_k=4e9, H_i=6e9)
    update = build_update(ENTRIES["von_mises"].law)
    eps = 5e-3 * np.random.default_rng(1).normal(size=(50, 6))
    found = update.sensitivities(eps, **values)
    mu, bulk, H = 200e9 / 2.6, 200e9 / (3 * 0.4), 10e9
    e = eps @ DEV
    q = np.linalg.norm(e, axis=1)
    n = e / q[:, None]
    p = (np.sqrt(6) * mu * q - 250e6) / (3 * mu + H)
    assert (p > 0).all()
    by_H = (np.sqrt(6) * mu * p / (3 * mu + H))[:, None] * n
    by_y = np.sqrt(6) * mu / (3 * mu + H) * n
    p_mu = (np.sqrt(6) * q - 3 * p) / (3 * mu + H)
    by_mu = 2 * e - np.sqrt(6) * (p + mu * p_mu)[:, None] * n
    by_E = by_mu / 2.6 + eps[:, :3].sum(axis=1)[:, None] * I6 / (3 * 0.4)
    by_nu = -by_mu * 200e9 / (2 * 1.3**2) + bulk * 2 / 0.4 * eps[:, :3].sum(axis=1)[:, None] * I6
    names = ["E", "H_i", "H_k", "nu", "sigma_y"]
    for j, right in enumerate((by_E, by_H, by_H, by_nu, by_y)):
        np.testing.assert_allclose(found.stress[:, :, j], right, atol=1e-12 * np.abs(right).max(), err_msg=names[j])
    np.testing.assert_allclose(found.state["p"][:, 1], -p / (3 * mu + H), rtol=1e-12)
    np.testing.assert_allclose(found.dissipation[:, 4], p + 250e6 * found.state["p"][:, 4], rtol=1e-11)


def hardening_laws():
    """Laws with what no law of the library has: a curved hardening energy, frozen or shared; an energy of the strain of no known form."""
    eps, eps_p, p = sym_tensor("eps"), sym_tensor("eps_p"), scalar("p")
    E, nu, y, Q, b, w, s = parameters("E nu y Q b w s")
    from sympy import exp, sqrt

    A, R = forces(eps_p, p)
    elastic = isotropic(E, nu).energy(eps - eps_p)
    voce = Q * (p + exp(-b * p) / b)
    rubber = w * sqrt(s**2 + inner(dev(eps), dev(eps)))
    domain = indicator(norm(dev(A)) + R - y)
    values = dict(E=1e3, nu=0.3, y=1.0, Q=2.0, b=30.0, w=5.0, s=1e-2)
    for name, psi in (("voce", elastic + voce), ("rubber", elastic + rubber + Q * p**2)):
        law = Law(name, psi=psi, phi_star=domain, observable=eps, internal=(eps_p, p))
        yield law, {q.name: values[q.name] for q in law.parameters}


@pytest.mark.parametrize(("law", "values"), list(hardening_laws()), ids=lambda x: getattr(x, "name", ""))
def test_curved_hardening_and_any_energy_of_the_strain_are_differentiated(law, values):
    rng = np.random.default_rng(6)
    update = build_update(law)
    assert update.solver in ("reduced", "closed")
    eps = np.exp(rng.uniform(-8, -3, size=(60, 1))) * rng.normal(size=(60, 6))
    state = {"eps_p": 1e-3 * rng.normal(size=(60, 6)) @ DEV, "p": np.abs(0.02 * rng.normal(size=60))}
    assert_derivatives(update, None, eps, state, {}, rng, values)


# -- paths -------------------------------------------------------------------------------------------------------------------

ROWS = 50


def cyclic(name, trace=None):
    """(control, targets, keywords): axial cycles with some torsion at lateral stress, or at a condition on the trace."""
    turn = np.linspace(0.0, 2 * np.pi, ROWS)
    lateral, size = {"perzyna": (0.0, 5e-3), "cam_clay": (-2e4, 1e-2)}.get(name, (-5e3, 2e-3))
    targets = np.zeros((ROWS, 6))
    targets[:, 2], targets[:, 5] = -size * np.sin(turn), 0.3 * size * np.sin(2 * turn)
    targets[:, :2] = lateral
    more = dict(times=np.linspace(0.0, 60.0, ROWS)) if name == "perzyna" else {}
    if trace is not None:
        targets[:, :2] = np.nan
        more |= dict(trace=trace, trace_targets=np.full(ROWS, -lateral if trace == "p" else 1e-4 * lateral / 1e4))
    return [True, True, False, False, False, False], targets, more


CASES = [(n, None) for n in ("sand", "texsol", "cam_clay", "perzyna", "mohr_coulomb")]
CASES += [("sand", "eps_v"), ("cam_clay", "p"), ("drucker_prager_cap", "eps_v")]


@pytest.mark.parametrize(("name", "trace"), CASES)
def test_a_cyclic_path_under_mixed_control_agrees_with_differences_of_whole_paths(name, trace):
    entry = ENTRIES[name]
    update = build_update(entry.law)
    control, targets, more = cyclic(name, trace)
    found = path_sensitivities(update, control, targets, entry.values, **more)
    mine = [found.eps, found.sig, *found.state.values(), found.dissipation]
    assert np.abs(found.history.state["eps_p"]).max() > 0.0
    for j, parameter in enumerate(found.names):

        def path(t, parameter=parameter):
            values = dict(entry.values)
            values[parameter] += t
            h = drive_arrays(update, control, targets, values, **more)
            return np.hstack([a.reshape(ROWS, -1) for a in (h.eps, h.sig, *h.state.values(), h.dissipation)])

        h = 5e-5 * entry.values[parameter]
        columns_ = [a[..., j].reshape(ROWS, -1) for a in mine]
        cuts = np.cumsum([a.shape[1] for a in columns_])[:-1]
        fine, coarse = derivative(path, 0.0, h), derivative(path, 0.0, 2 * h)
        groups = [np.split(a, cuts, axis=1) for a in (np.hstack(columns_), fine, coarse)]
        for right, rough, my in zip(groups[1], groups[2], groups[0], strict=True):
            size = np.abs(right).max()
            smooth = np.abs(right - rough).max(axis=1) <= 1e-5 * size
            assert smooth.mean() > 0.35, (name, parameter)
            assert np.abs(my - right)[smooth].max(initial=0.0) <= 1e-6 * size + 1e-12, (name, parameter)


@pytest.mark.parametrize("name", ["texsol", "mohr_coulomb", "perzyna", "cam_clay"])
def test_along_a_strain_path_the_stress_stays_of_degree_one_in_the_stresses_of_the_law(name):
    entry, rng = ENTRIES[name], np.random.default_rng(8)
    corners = 3 * np.linalg.norm(entry.worked.eps) * rng.normal(size=(6, 6)) / np.sqrt(6)
    targets = np.concatenate([np.linspace(a, b, 40) for a, b in pairwise(np.vstack([np.zeros(6), corners]))])
    update = build_update(entry.law)
    stresses = [p.name for p in entry.law.parameters if p.unit.startswith("Pa")]
    found = path_sensitivities(update, [False] * 6, targets, entry.values, wrt=stresses)
    theta = np.array([entry.values[s] for s in stresses])
    size = np.abs(found.sig * theta).max()
    assert np.abs(found.sig @ theta - found.history.sig).max() <= 1e-9 * size
    assert np.abs(found.eps).max() == 0.0
    assert np.abs(found.dissipation @ theta - found.history.dissipation).max() <= 1e-9 * found.history.dissipation[-1]


def test_temperature_is_a_parameter_too_and_may_differ_from_row_to_row():
    entry = ENTRIES["thermo_elasto_plastic"]
    update, T = build_update(entry.law), np.linspace(280.0, 340.0, 12)
    targets = np.zeros((12, 6))
    targets[:, 2] = np.linspace(0.0, 4e-3, 12)
    control = [True, True, False, False, False, False]
    found = path_sensitivities(update, control, targets, entry.values, temperatures=T, wrt="T")
    assert found.names == ("T",)

    def path(t):
        return drive_arrays(update, control, targets, entry.values, temperatures=T + t).sig

    right = derivative(path, 0.0, 1e-3)
    np.testing.assert_allclose(found.sig[:, :, 0], right, atol=1e-6 * np.abs(right).max())


@pytest.mark.parametrize("name", ["drucker_prager", "mohr_coulomb", "texsol"])
def test_the_general_method_differentiates_its_cone_program_to_the_same_numbers(name):
    assert_parity(name, 8)


@pytest.mark.validate
@pytest.mark.parametrize(
    "name", ["cam_clay", "drucker_prager_cap", "mobilised_friction", "thermo_elasto_plastic", "bingham"]
)
def test_the_general_method_agrees_with_the_reduced_ones_on_the_rest(name):
    assert_parity(name, 3)


def assert_parity(name, count):
    entry, rng = ENTRIES[name], np.random.default_rng(9)
    # no exactly equal principal values: the multipliers of eigenvalue cones are not unique there, nor is the general method's tangent
    chosen = [random_states(entry, rng, count, amplitude) for amplitude in (0.1, 1.0, 20.0)]
    eps, state, heat = parts(entry, {key: np.concatenate([x[key] for x in chosen]) for key in chosen[0]})
    names = [p.name for p in entry.law.parameters] + list(heat)
    d_eps = 1e-3 * rng.normal(size=(len(eps), 6, len(names)))
    d_state = {k: 1e-3 * rng.normal(size=(*a.shape, len(names))) for k, a in state.items()}
    arguments = dict(wrt=names, d_state=d_state, d_eps=d_eps, **entry.values, **heat)
    general = build_update(entry.law, solver="general").sensitivities(eps, state, DT, **arguments)
    reduced = build_update(entry.law).sensitivities(eps, state, DT, **arguments)
    for j, parameter in enumerate(names):
        pairs = list(zip(columns(general, j), columns(reduced, j), strict=True))
        for mine, right in pairs[:-1]:
            assert np.abs(mine - right).max() <= 1e-8 * np.abs(right).max() + 1e-300, parameter
        # the dissipation is a product of forces and increments whose derivatives nearly cancel
        mine, right = pairs[-1]
        assert np.abs(mine - right).max() <= 1e-6 * np.abs(right).max() + 1e-300, parameter


# -- bad input -----------------------------------------------------------------------------------------------------------------


def test_what_cannot_be_differentiated_is_refused_in_one_line():
    entry = ENTRIES["sand"]
    update, eps = build_update(entry.law), np.zeros((2, 6))
    with pytest.raises(InputError, match=r"no parameter 'E'.*C_0, E_s"):
        update.sensitivities(eps, wrt="E", **entry.values)
    with pytest.raises(InputError, match="twice"):
        update.sensitivities(eps, wrt=["E_s", "E_s"], **entry.values)
    with pytest.raises(InputError, match=r"d_eps has shape \(2, 6\)"):
        update.sensitivities(eps, d_eps=eps, **entry.values)
    with pytest.raises(InputError, match="d_state names 'q'"):
        update.sensitivities(eps, d_state={"q": eps}, **entry.values)
    power = ENTRIES["perzyna"]
    with pytest.raises(DeclarationError, match="general method"):
        build_update(power.law, solver="general").sensitivities(eps, **power.values)


def test_a_control_that_leaves_a_strain_rate_open_is_said_not_answered():
    # Mohr-Coulomb at an edge: equal lateral stresses say nothing on how the lateral strains share their sum
    entry = ENTRIES["mohr_coulomb"]
    control, targets, more = cyclic("mohr_coulomb", "eps_v")
    with pytest.raises(ConvergenceError, match="undetermined"):
        path_sensitivities(build_update(entry.law), control, targets, entry.values, **more)


def test_a_state_without_points_and_without_names_has_empty_derivatives():
    update = build_update(ENTRIES["sand"].law)
    assert update.sensitivities(np.zeros((0, 6)), **ENTRIES["sand"].values).stress.shape == (0, 6, 6)
    assert update.sensitivities(np.zeros((3, 6)), wrt=(), **ENTRIES["sand"].values).stress.shape == (3, 6, 0)
    assert all(isinstance(v, ScalarVariable) or v.rank == 2 for v in update.law.internal)
