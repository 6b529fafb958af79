"""Order in step size against closed forms of the rate equations, exactness on radial paths, and the promise of the explicit scheme.

Maxwell       shear at constant rate ė:      s = 2ηė (1 − e^{−μt/η});
Bingham       the same beyond yield:         ‖S‖ = √2 τ_y + 2ηė (1 − e^{−μt/η});
Kelvin–Voigt  creep at constant stress s:    e = s/2μ (1 − e^{−μt/η});
Norton        relaxation at fixed strain:    q^{1−n} = q₀^{1−n} + (n − 1) 3μ ε̇₀ t/σ₀^n;
Perzyna       the same of the overstress y, hardening with it: y^{1−n} = y₀^{1−n} + (n − 1)(3μ + H_i) ε̇₀ t/σ₀^n;
von Mises     perfect, turning on its surface at constant ė: tan(ϑ/2) = tan(ϑ₀/2) e^{−2G‖ė‖t/R}, ϑ from ė to S, R = √(2/3) σ_y
              (Krieg and Krieg 1977).
"""

import numpy as np
import pytest
from extreme_steps import RADIAL, STRENGTH
from law_truth import lame

from fenchel.integrators import drive_arrays
from fenchel.integrators.explicit import ExplicitUpdate
from fenchel.potentials.library import ENTRIES, LAWS

SHEAR = np.array([0.0, 0, 0, 0, 0, 1.0])
ROOT2, ROOT32 = np.sqrt(2.0), np.sqrt(1.5)
SUDDEN = 1e-14  # [s] a step so short that nothing flows


def values_of(name):
    values = dict(ENTRIES[name].values)
    return values, lame(values["E"], values["nu"])[1]


class Maxwell:
    """(start, strain at s in [0, 1], duration, stress at the end along SHEAR)"""

    name = "maxwell"
    values, mu = values_of("maxwell")
    duration = 2 * values["eta"] / mu
    rate = 1e-3
    exact = 2 * values["eta"] * rate * (1 - np.exp(-mu * duration / values["eta"]))
    start = 0.0

    @classmethod
    def strain(cls, s):
        return cls.rate * cls.duration * s


class Bingham(Maxwell):
    name = "bingham"
    values, mu = values_of("bingham")
    duration = 2 * values["eta"] / mu
    start = ROOT2 * values["tau_y"] / (2 * mu)
    exact = ROOT2 * values["tau_y"] + 2 * values["eta"] * Maxwell.rate * (1 - np.exp(-mu * duration / values["eta"]))

    @classmethod
    def strain(cls, s):
        return cls.start + cls.rate * cls.duration * s


class Norton(Maxwell):
    name = "norton"
    values, mu = values_of("norton")
    n, sigma_0, rate_0 = values["n"], values["sigma_0"], values["rate_0"]
    first = 2 * sigma_0  # q at the start
    slope = 3 * mu * rate_0
    duration = 0.3 * sigma_0 / slope
    start = first / ROOT32 / (2 * mu)
    exact = (first ** (1 - n) + (n - 1) * slope * duration / sigma_0**n) ** (1 / (1 - n)) / ROOT32

    @classmethod
    def strain(cls, s):
        return cls.start


class Perzyna(Norton):
    name = "perzyna"
    values, mu = values_of("perzyna")
    n, sigma_0, rate_0, H_i = values["n"], values["sigma_0"], values["rate_0"], values["H_i"]
    slope = 3 * mu * rate_0
    whole = (3 * mu + H_i) * rate_0
    first = 2 * sigma_0
    duration = 0.3 * sigma_0 / whole
    start = (values["sigma_y"] + first) / ROOT32 / (2 * mu)
    left = (first ** (1 - n) + (n - 1) * whole * duration / sigma_0**n) ** (1 / (1 - n))
    # of what the overstress lost, the stress lost its share 3μ/(3μ + H_i)
    exact = (values["sigma_y"] + first - (first - left) * slope / whole) / ROOT32


VISCOUS = [Maxwell, Bingham, Norton, Perzyna]


def implicit(case, steps):
    update, state = LAWS[case.name].compile(), None
    if case.start:
        state = update(case.start * SHEAR, None, SUDDEN, **case.values).state
    for k in range(1, steps + 1):
        out = update(case.strain(k / steps) * SHEAR, state, case.duration / steps, **case.values)
        state = out.state
    return out.stress[0] @ SHEAR


def observed_order(error):
    errors = np.array([error(n) for n in (50, 100, 200)])
    orders = np.log2(errors[:-1] / errors[1:])
    assert ((orders >= 0.9) & (orders <= 1.1)).all(), (errors, orders)
    return errors


@pytest.mark.parametrize("case", VISCOUS, ids=lambda case: case.name)
def test_implicit_steps_are_of_first_order(case):
    errors = observed_order(lambda n: abs(implicit(case, n) - case.exact) / case.exact)
    assert errors[-1] <= 0.01


def test_creep_of_kelvin_voigt_is_of_first_order():
    values, mu = values_of("kelvin_voigt")
    update, s = LAWS["kelvin_voigt"].compile(), 2e3
    duration = 2 * values["eta"] / mu
    exact = s / (2 * mu) * (1 - np.exp(-mu * duration / values["eta"]))

    def error(n):
        times = np.arange(n + 1) * duration / n
        targets = np.vstack([np.zeros(6), np.tile(s * SHEAR, (n, 1))])
        history = drive_arrays(update, [True] * 6, targets, values, times=times)
        return abs(history.eps[-1] @ SHEAR - exact) / exact

    assert observed_order(error)[-1] <= 0.01


@pytest.mark.parametrize("name", RADIAL)
def test_one_step_is_a_thousand_on_a_radial_path(name):
    values, update = dict(ENTRIES[name].values), LAWS[name].compile()
    young = values.get("E", values.get("E_s"))
    end = 10 * values[STRENGTH[name]] / young * np.array(RADIAL[name])
    path = np.arange(1, 1001)[:, None] / 1000 * end
    many = drive_arrays(update, [False] * 6, path, values)
    one = update(end, None, **values)
    assert one.dissipation[0] > 0
    # a thousand roundings of numbers of the size of the trial stress
    assert np.abs(many.sig[-1] - one.stress[0]).max() <= 1000 * 2.3e-16 * young * np.abs(end).max()
    for key, value in one.state.items():
        assert np.abs(many.state[key][-1] - value[0]).max() <= 1000 * 2.3e-16 * np.abs(end).max()


# -- the explicit scheme --------------------------------------------------------------------------------------------------------


def turning():
    """(values, start, end, exact stress): von Mises without hardening from a point of its surface."""
    values = ENTRIES["von_mises"].values | {"H_k": 0.0, "H_i": 0.0}
    G, R = lame(values["E"], values["nu"])[1], values["sigma_y"] / ROOT32
    along, across = SHEAR, np.array([0.0, 0, 0, 0, 1.0, 0])
    angle, travel = 1.5, 1.5 * R / (2 * G)
    S = R * (np.cos(angle) * along + np.sin(angle) * across)
    turned = 2 * np.arctan(np.tan(angle / 2) * np.exp(-2 * G * travel / R))
    exact = R * (np.cos(turned) * along + np.sin(turned) * across)
    # a hair inside, so that the start is admissible to the last digit
    return values, S / (2 * G) * (1 - 1e-13), S / (2 * G) + travel * along, exact


def explicit_error(case, tolerance):
    """Largest error of stress over the stress of the answer."""
    if case == "von_mises":
        values, start, end, exact = turning()
        update = ExplicitUpdate(LAWS[case], tolerance)
        state = update.initial_state(1) | {"eps": start[None]}
        out = update(end, state, **values)
    else:
        exact, values = case.exact * SHEAR, case.values
        update = ExplicitUpdate(LAWS[case.name], tolerance)
        state = update.initial_state(1) | {"eps": case.start * SHEAR[None]}
        out = update(case.strain(1.0) * SHEAR, state, case.duration, **values)
    return np.abs(out.stress[0] - exact).max() / np.abs(exact).max()


LONG = [pytest.param(t, marks=pytest.mark.validate) for t in (1e-5, 1e-6, 1e-7, 1e-9)]
TOLERANCES = [1e-3, 1e-4, *LONG]


@pytest.mark.parametrize("tolerance", TOLERANCES)
@pytest.mark.parametrize("case", [*VISCOUS, "von_mises"], ids=lambda case: case if isinstance(case, str) else case.name)
def test_the_explicit_error_is_below_what_was_promised(case, tolerance):
    # the promise is per sub-step; these flows are contractions, so that errors do not add up
    assert explicit_error(case, tolerance) <= tolerance
