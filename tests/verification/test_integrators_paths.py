"""Paths of material points against closed forms: elastic moduli of the composite, plastic slopes, undrained and isobaric control."""

import numpy as np
import pytest

from fenchel.integrators import drive, drive_arrays
from fenchel.potentials import lame, parameters
from fenchel.potentials.library import ENTRIES, drucker_prager, reinforced_sand, sand, texsol, von_mises

SAND = {"E_s": 12e6, "nu_s": 0.2, "theta_f": 0.079, "C_0": 2842.0, "H_k": 944e3, "H_i": 472e3}
UNIAXIAL = [True, True, False, True, True, True]


def wire_values(E_w, nu_w=0.2):
    lam, mu = lame(E_w, nu_w)
    return {"lambda_w": float(lam), "mu_w": float(mu)}


def axial(path):
    targets = np.zeros((len(path), 6))
    targets[:, 2] = path
    return targets


@pytest.mark.parametrize(
    ("E_s", "E_w", "tension", "compression"),
    [(12.167e6, 0.332e6, 12.4765e6, 12.1888e6), (12e6, 6e6, 17.5e6, 12.3077e6)],
)
def test_elastic_moduli_of_the_composite(E_s, E_w, tension, compression):
    # theory §4: both moduli in closed form, and the printed values of its table
    wires = wire_values(E_w)
    lam_s, mu_s = (float(x) for x in lame(E_s, 0.2))
    lam_w, mu_w = wires["lambda_w"], wires["mu_w"]
    both = lam_s + lam_w
    slope = -both / (2 * both + 2 * mu_s)
    exact_t = both * (1 + 2 * slope) + 2 * (mu_s + mu_w)
    slope = -lam_s / (2 * lam_s + 2 * mu_s + 2 * mu_w)
    exact_c = lam_s * (1 + 2 * slope) + 2 * mu_s
    values = SAND | wires | {"E_s": E_s, "C_0": 1e9}
    update = texsol.compile()
    for strain, exact, printed in ((1e-4, exact_t, tension), (-1e-4, exact_c, compression)):
        history = drive_arrays(update, UNIAXIAL, axial([strain]), values)
        assert history.sig[0, 2] / strain == pytest.approx(exact, rel=1e-7)
        assert history.sig[0, 2] / strain == pytest.approx(printed, rel=1e-5)
    bilateral = drive_arrays(reinforced_sand.compile(), UNIAXIAL, axial([-1e-4]), values)
    assert bilateral.sig[0, 2] / -1e-4 == pytest.approx(E_s + E_w, rel=1e-9)


def test_hardening_slope_of_von_mises_in_uniaxial_tension():
    E, H = 200e9, 3e9
    values = {"E": E, "nu": 0.3, "sigma_y": 250e6, "H_k": 2e9, "H_i": 1e9}
    history = drive_arrays(von_mises.compile(), UNIAXIAL, axial(np.linspace(0, 0.02, 50)), values)
    strain = history.eps[-1, 2]
    assert history.sig[-1, 2] == pytest.approx(250e6 + E * H / (E + H) * (strain - 250e6 / E), rel=1e-10)


def test_onset_of_yield_in_triaxial_compression():
    # theory §13.2: √J₂ = (C_0 + P t)/(1 − t/√3) at confining pressure P
    P, t = 7e4, np.tan(0.3)
    values = SAND | {"theta_f": 0.3, "H_k": 0.0, "H_i": 0.0}
    targets = axial(np.concatenate([[-0.0028], np.linspace(-0.003, -0.1, 40)]))
    targets[:, :2] = -P
    history = drive_arrays(sand.compile(), UNIAXIAL, targets, values)
    q = abs(history.sig[-1, 2] - history.sig[-1, 0])
    assert q / np.sqrt(3) == pytest.approx((2842.0 + P * t) / (1 - t / np.sqrt(3)), rel=1e-9)
    assert history.sig[:, 0] == pytest.approx(-P, rel=1e-10)


def test_one_number_rules_a_monotonic_path_and_a_reversal_tells_two_apart():
    # theory §13.4: H_k (1/2 + t²/3) + H_i
    t = np.tan(0.079)
    update = sand.compile()
    one = SAND
    two = SAND | {"H_k": 0.0, "H_i": 944e3 * (0.5 + t * t / 3) + 472e3}
    rest = -7e4 * (1 - 2 * 0.2) / 12e6  # the first row compresses isotropically
    targets = axial(rest + np.concatenate([np.linspace(0, -0.01, 50), np.linspace(-0.01, 0.01, 100)]))
    targets[:, :2] = -7e4
    a, b = (drive_arrays(update, UNIAXIAL, targets, v) for v in (one, two))
    assert np.abs(a.sig[:50] - b.sig[:50]).max() <= 1e-6 * 2842
    assert np.abs(a.sig[50:] - b.sig[50:]).max() >= 0.1 * 2842


@pytest.mark.parametrize("law", [sand, texsol], ids=lambda law: law.name)
def test_dissipation_is_cohesion_times_hardening_variable_at_every_step(law):
    values = SAND | (wire_values(6e6) if law is texsol else {})
    rng = np.random.default_rng(2)
    targets = np.cumsum(1e-3 * rng.normal(size=(300, 6)), axis=0)
    history = drive_arrays(law.compile(), [False] * 6, targets, values)
    steps, moved = np.diff(history.dissipation), np.diff(history.state["p"])
    assert (steps >= 0).all()
    assert np.abs(steps - 2842.0 * moved).max() <= 1e-9 * 2842.0 * moved.max()
    # energy balance of implicit Euler: work of the mean stress exceeds stored and lost energy by a second-order amount only
    assert history.psi.min() >= 0


def test_undrained_and_isobaric_control(tmp_path):
    values = SAND | {"theta_f": 0.3}
    file = tmp_path / "path.csv"
    rows = "\n".join(f"{i},{-1e-4 * i},0" for i in range(50))
    file.write_text("t,eps_zz,eps_v\n" + rows + "\n")
    undrained = drive(sand, file, values)
    assert np.abs(undrained.eps[:, :3].sum(axis=1)).max() <= 1e-17
    assert np.abs(undrained.sig[:, 0] - undrained.sig[:, 1]).max() <= 1e-9 * 2842
    exact = np.zeros((50, 6))
    exact[:, 2] = -1e-4 * np.arange(50)
    exact[:, 0] = exact[:, 1] = -exact[:, 2] / 2
    forced = drive_arrays(sand.compile(), [False] * 6, exact, values)
    assert np.abs(forced.sig - undrained.sig).max() <= 1e-8 * 2842
    file.write_text("t,eps_zz,sig_xx,eps_v\n0,0,0,0\n1,0,-5e4,-1e-3\n2,-2e-3,-5e4,-1e-3\n3,-9e-3,-4e4,-2e-3\n")
    one = drive(sand, file, values)
    assert one.sig[1:, 0] == pytest.approx([-5e4, -5e4, -4e4], rel=1e-10)
    assert one.eps[:, :3].sum(axis=1) == pytest.approx([0, -1e-3, -1e-3, -2e-3], abs=1e-17)
    file.write_text("t,eps_zz,p\n0,0,0\n" + "\n".join(f"{i},{-1e-4 * i},5e4" for i in range(1, 40)) + "\n")
    isobaric = drive(sand, file, values)
    assert -isobaric.sig[1:, :3].mean(axis=1) == pytest.approx(5e4, rel=1e-10)


def test_stress_control_reproduces_the_strains_of_strain_control():
    rng = np.random.default_rng(9)
    values = SAND | wire_values(6e6)
    update = texsol.compile()
    targets = np.cumsum(4e-4 * rng.normal(size=(60, 6)), axis=0)
    forward = drive_arrays(update, [False] * 6, targets, values)
    back = drive_arrays(update, [True] * 6, forward.sig, values)
    assert np.abs(back.eps - targets).max() <= 1e-9 * np.abs(targets).max()


def test_equal_strain_bounds_of_the_wire_stress():
    # theory §3: √J₂ of the unilateral stress is at most that of the bilateral one, its pressure at most min(0, bilateral)
    rng = np.random.default_rng(4)
    E_s, nu_s = parameters("E_s nu_s")
    assert E_s != nu_s
    strains = 1e-3 * rng.normal(size=(20000, 6))
    values = SAND | wire_values(6e6) | {"C_0": 1e9}
    base = sand.compile(tangent=False)(strains, None, **{k: values[k] for k in SAND}).stress
    uni = texsol.compile(tangent=False)(strains, None, **values).stress - base
    bil = reinforced_sand.compile(tangent=False)(strains, None, **values).stress - base
    mean_u, mean_b = uni[:, :3].mean(axis=1), bil[:, :3].mean(axis=1)
    i6 = np.array([1.0, 1, 1, 0, 0, 0])
    q_u, q_b = (np.linalg.norm(s - m[:, None] * i6, axis=1) for s, m in ((uni, mean_u), (bil, mean_b)))
    assert (q_u <= q_b * (1 + 1e-9) + 1e-7).all()
    assert (-mean_u <= np.minimum(0.0, -mean_b) + 1e-6).all()


def test_replaced_parameters_give_the_same_numbers():
    E_w, nu_w = parameters("E_w nu_w")
    lam, mu = lame(E_w, nu_w)
    law = texsol.with_parameters(lambda_w=lam, mu_w=mu)
    strain = np.array([1e-3, 2e-3, -3e-3, 1e-4, 0, 2e-4])
    one = law.compile()(strain, None, **SAND, E_w=6e6, nu_w=0.2).stress
    two = texsol.compile()(strain, None, **SAND, **wire_values(6e6)).stress
    assert np.allclose(one, two, rtol=1e-13)


def test_perfect_plasticity_flows_at_constant_stress():
    values = {"E": 12e6, "nu": 0.2, "theta_f": 0.0, "C_0": 1000.0, "H_i": 0.0}
    history = drive_arrays(drucker_prager.compile(), UNIAXIAL, axial(np.linspace(0, 0.01, 30)), values)
    assert history.sig[-1, 2] == pytest.approx(np.sqrt(3) * 1000.0, rel=1e-9)


def test_a_path_by_the_conic_program_equals_the_closed_form(tmp_path):
    values = {"E": 12e6, "nu": 0.2, "theta_f": 0.3, "C_0": 2842.0, "H_i": 1e6}
    file = tmp_path / "path.csv"
    file.write_text("t,eps_zz,eps_yy,sig_xx\n0,0,0,0\n1,-2e-3,0,-2e3\n2,2e-3,0,-1e3\n")
    closed, conic = drive(drucker_prager, file, values), drive(drucker_prager, file, values, solver="conic")
    assert closed.dissipation[-1] > 0
    assert np.abs(conic.sig - closed.sig).max() <= 1e-6 * 2842
    assert np.abs(conic.eps - closed.eps).max() <= 1e-9
    assert conic.psi == pytest.approx(closed.psi, rel=1e-6, abs=1e-9)
    assert conic.dissipation == pytest.approx(closed.dissipation, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("solver", ["auto", "general"])
@pytest.mark.parametrize("rows", [1, 10])
def test_free_thermal_expansion_leaves_no_stress(solver, rows):
    """ε = α (T − T₀) 𝕀 and σ = 0: the stress that is found is rounding, and must not be the measure of itself."""
    entry = ENTRIES["thermo_elasto_plastic"]
    values = dict(entry.values)
    update = entry.law.compile(solver=solver)
    ends = np.linspace(250.0, 450.0, 41 if solver == "auto" else 5)
    for end in ends:
        heat = np.linspace(values["T_0"], end, rows + 1)[1:]
        found = drive_arrays(update, [True] * 6, np.zeros((rows, 6)), values, temperatures=heat)
        free = values["alpha_T"] * (heat - values["T_0"])
        assert np.abs(found.eps - free[:, None] * np.array([1.0, 1, 1, 0, 0, 0])).max() < 1e-12 * (
            abs(free).max() + 1e-3
        )
        assert np.abs(found.sig).max() < 1e-10 * values["E"] * (abs(free).max() + 1e-6)
