"""The library: every law comes with its source, values and a worked value; readings of a friction angle; the example of the README."""

import re
from pathlib import Path

import numpy as np
import pytest
from sympy import Symbol, sqrt, symbols, tan

from fenchel.errors import InputError
from fenchel.potentials import Law, dev, forces, indicator, norm, tr
from fenchel.potentials.library import ENTRIES, LAWS, cone, cone_values, rescaled_pseudo_norm, sand, triaxial_friction

ROOT = Path(__file__).parents[2]
ISSUE = """linear_elastic wire sand reinforced_sand texsol drucker_prager von_mises tresca mohr_coulomb rankine cam_clay norton perzyna
bingham maxwell kelvin_voigt thermo_elasto_plastic""".split()  # noqa: SIM905


def test_the_registry_finds_every_file():
    files = {f.stem[1:] for f in (ROOT / "potentials" / "library").glob("_[a-z]*.py")} - {"cones", "entry", "symbols"}
    assert set(LAWS) == set(ENTRIES) == files
    assert set(ISSUE) <= files
    assert all(LAWS[name].name == name and LAWS[name] is entry.law for name, entry in ENTRIES.items())


@pytest.mark.parametrize("name", LAWS)
def test_every_law_has_a_source_units_bounds_and_values(name):
    entry = ENTRIES[name]
    law = entry.law
    assert law.note and re.search(r"[A-Z][a-z]+.* \d{4}", entry.source)
    for symbol in law.parameters:
        assert symbol.unit and symbol.note and np.isfinite(symbol.lower), symbol
    assert set(law.values(entry.values)) == set(entry.values)
    assert law.check(**entry.values).admissible is True


@pytest.mark.parametrize("name", LAWS)
def test_the_worked_value_comes_out(name):
    """One implicit step from the virgin state; the answer is data of the library and comes from a closed form."""
    entry = ENTRIES[name]
    worked = entry.worked
    out = entry.law.compile()(np.array([worked.eps]), None, worked.dt, **entry.values, **worked.temperatures)
    exact = np.array(worked.stress)
    close = 10.0**-worked.digits * 100
    assert out.stress[0] == pytest.approx(exact, abs=close * np.abs(exact).max())
    for variable, value in worked.state.items():
        assert out.state[variable][0] == pytest.approx(value, rel=100 * close)
    assert "closed form" in worked.source


def test_readings_of_a_friction_angle():
    phi, c = symbols("phi c", positive=True)
    a, k = cone(phi, c, "compression")
    table = {phi: 0.5, c: 10.0}
    assert cone(0.5, 10.0, "compression") == pytest.approx((float(a.subs(table)), float(k.subs(table))))
    # cohesionless and frictionless limits
    for reading in ("shear_limit", "sine", "compression", "extension", "plane_strain"):
        assert cone(0.0, 10.0, reading)[0] == 0.0
        assert cone(0.5, 0.0, reading)[1] == 0.0
    assert cone(0.0, 9.0, "plane_strain")[1] == pytest.approx(9.0)  # Tresca in plane strain: √J₂ = c
    # the apex of Mohr–Coulomb, p = c cot φ, is that of its cones
    for reading in ("compression", "extension", "plane_strain"):
        a, k = cone(0.5, 10.0, reading)
        assert k / (3 * a) == pytest.approx(10.0 / np.tan(0.5))
    for bad in (dict(reading="inner"), dict(form="tau")):
        with pytest.raises(InputError, match="is not known; it is one of"):
            cone(0.5, 1.0, **bad)
    found = cone_values(*cone(0.4, 7.0, "sine"))
    assert np.tan(found["theta_f"]) / 3 == pytest.approx(np.sin(0.4) / 3)
    assert found["C_0"] == pytest.approx(7.0 * np.cos(0.4))
    assert cone_values(Symbol("a"), Symbol("k"))["C_0"] == Symbol("k")


@pytest.mark.parametrize(("theta_f", "C_0"), [(0.0, 3e3), (0.079, 2842.0), (0.48, 4e3), (0.48, 0.0), (1.04, 1e3)])
def test_the_friction_of_a_triaxial_test_is_that_of_the_stresses_at_first_yield(theta_f, C_0):
    read = triaxial_friction(theta_f, C_0)
    for P in (1e3, 5e4, 2e5):
        # triaxial compression on the cone: √J₂ = (σ_r − σ_a)/√3, mean pressure P
        q = np.sqrt(3.0) * (C_0 + P * np.tan(theta_f))
        largest, smallest = P + 2.0 * q / 3.0, P - q / 3.0  # principal pressures
        shear, mean = (largest - smallest) / 2.0, (largest + smallest) / 2.0
        assert shear == pytest.approx(read["c"] * np.cos(read["phi"]) + mean * np.sin(read["phi"]), rel=1e-12)


def test_a_cone_too_steep_for_a_friction_angle_is_refused():
    for theta_f in (np.pi / 3, 1.05, 1.5, 3.3, -0.1):
        with pytest.raises(InputError, match="it needs 0 to 60°"):
            triaxial_friction(theta_f, 1e3)


def test_a_scaled_pseudo_norm_is_the_same_law_with_scaled_hardening():
    factor, values = 2.5, ENTRIES["sand"].values
    force, chi, resistance = forces(*sand.internal)
    theta_f, C_0 = (next(q for q in sand.parameters if q.name == name) for name in ("theta_f", "C_0"))
    f = factor * (norm(dev(force + chi)) / sqrt(2) + tan(theta_f) / 3 * tr(force + chi)) + resistance - C_0
    law = Law("scaled", psi=sand.psi, phi_star=indicator(f), observable=sand.observable, internal=sand.internal)
    scaled = values | rescaled_pseudo_norm(factor, C_0=values["C_0"], H_i=values["H_i"])
    eps = np.array([ENTRIES["sand"].worked.eps])
    one, two = sand.compile()(eps, None, **values), law.compile()(eps, None, **scaled)
    assert two.stress == pytest.approx(one.stress, rel=1e-12)
    assert two.state["p"] * factor == pytest.approx(one.state["p"], rel=1e-12)
    assert two.dissipation == pytest.approx(one.dissipation, rel=1e-12)
    with pytest.raises(InputError, match="positive factor"):
        rescaled_pseudo_norm(-1.0, C_0=1.0, H_i=1.0)


def test_the_law_of_the_readme_takes_at_most_twelve_lines_and_is_texsol():
    (block,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    found: dict = {}
    exec(block, found)
    (law,) = [value for value in found.values() if isinstance(value, Law)]
    assert {q.name for q in law.parameters} == {q.name for q in LAWS["texsol"].parameters}
    lines = [line for line in block.splitlines() if line.strip() and not line.startswith(("from ", "import "))]
    assert len(lines) <= 12
    entry = ENTRIES["texsol"]
    out = law.compile()(np.array([entry.worked.eps]), None, **entry.values)
    assert out.stress[0] == pytest.approx(np.array(entry.worked.stress), rel=1e-12, abs=1e-8)
