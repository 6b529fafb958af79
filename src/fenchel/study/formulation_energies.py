"""Claims 4 and 10: one free energy in the strain or in the stress, of one phase and of two.

With u = ψ + Ts, the power that is not stored, σ:ε̇ − (u̇ − Tṡ), follows from ψ by differences of u and s along a process, and from ψ* by

    u̇ − Tṡ = ε̇:σ + (ε − ∂ψ*/∂σ):σ̇ + (s − ∂ψ*/∂T) Ṫ − Σ ∂ψ*/∂α·α̇,

each derivative of ψ* by differences in one argument alone. Of phases at equal strain ψ* is an infimal convolution (Rockafellar
1970, §16):

    ψ*(σ) = min over σ_s + σ_w = σ of ψ_s*(σ_s) + ψ_w*(σ_w),   a semidefinite program where the wires take no compression.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..potentials import partial_conjugate
from ..potentials.library import ENTRIES, Entry
from ..potentials.spectral import as_matrix
from .formulation_states import (
    IDENTITY,
    Array,
    Numbers,
    corners,
    difference,
    distinct_energies,
    dot,
    elasticity,
    from_kinks,
    given_heat,
    is_one_sided,
    is_slack,
    magnitude,
    random_states,
    rotated,
    size_of,
    supremum,
)

__all__ = ["balances", "superposition"]

Motion = Callable[[float], dict[str, Array]]


# -- claim 4 --------------------------------------------------------------------------------------------------------------------


def _process(entry: Entry, numbers: Numbers, rng: np.random.Generator, n: int) -> tuple[Motion, Motion]:
    """n smooth motions of all variables about time 0 (sums of two sines), and their rates; scalars and the temperature stay positive."""
    size, start = magnitude(entry), random_states(entry, rng, n)
    slack = is_slack(numbers, start)
    motion, rate = {}, {}
    for name, value in start.items():
        a, b, c = rng.normal(size=(3, *value.shape))
        amplitude, offset = 0.1 * size, value if value.ndim > 1 else np.asarray(size)
        if name in given_heat(entry.law, start):
            amplitude, offset = 30.0, np.asarray(320.0)
        elif slack and name == entry.law.observable.name:  # keep the stress inside the cone where ψ* is finite
            amplitude, offset = 0.02 * size, size / 4 * rotated(rng, np.tile([1.0, 2.0, 3.0], (n, 1)))
        motion[name] = (amplitude, offset, a, b, c)
    rate = {k: (s, a, b, c) for k, (s, _, a, b, c) in motion.items()}

    def place(t: float) -> dict[str, Array]:
        return {k: o + s * (a * np.sin(t + c) + b * np.sin(2 * t - c)) for k, (s, o, a, b, c) in motion.items()}

    def speed(t: float) -> dict[str, Array]:
        return {k: s * (a * np.cos(t + c) + 2 * b * np.cos(2 * t - c)) for k, (s, a, b, c) in rate.items()}

    return place, speed


def _balance(entry: Entry, rng: np.random.Generator, n: int) -> tuple[Array, Array]:
    """Relative difference of the two forms, and of the first and Σ A·α̇, at those of n processes that are far from a kink."""
    law, h = entry.law, 2e-3
    numbers = Numbers(law, entry.values)
    place, speed = _process(entry, numbers, rng, n)
    here, rate = place(0.0), speed(0.0)
    observable, heat = law.observable.name, "" if law.temperature is None else law.temperature.name
    temperature, warming = (here[heat], rate[heat]) if heat else (np.zeros(n), np.zeros(n))
    stress, strain = numbers.stress(here), here[observable]

    def stored(t: float) -> Array:
        state = place(t)
        return numbers.energy(state) + state.get(heat, np.zeros(n)) * numbers.entropy(state)

    def dual(stress: Array, **changed: Array) -> Array:
        return supremum(numbers, stress, {**here, **changed}, strain)[0]

    def slope(name: str) -> Array:
        return difference(lambda t: dual(stress, **{name: here[name] + t * rate[name]}), h)

    power = dot(stress, rate[observable])
    entropy_rate = difference(lambda t: numbers.entropy(place(t)), h)
    by_strain = power - (difference(stored, h) - temperature * entropy_rate)
    stress_rate = difference(lambda t: numbers.stress(place(t)), h)
    by_stress = difference(lambda t: dual(stress + t * stress_rate), h)
    slopes = {name: slope(name) for name in rate if name != observable}
    change = (
        power
        + (dot(strain, stress_rate) - by_stress)
        + numbers.entropy(here) * warming
        - sum(slopes.values(), 0.0 * power)
    )
    reduced = sum((dot(numbers.force(v, here), rate[v.name]) for v in law.internal), np.zeros(n))
    scale = size_of(stress) * size_of(rate[observable]) + size_of(strain) * size_of(stress_rate)
    scale = scale + np.abs(temperature * entropy_rate) + sum(map(np.abs, slopes.values()), 0.0)
    clear = np.ones(n, dtype=bool)
    if is_one_sided(numbers, here):  # no kink in the windows of the differences, nor near them
        clear = from_kinks(strain) > 60 * h * sum(size_of(v) for k, v in rate.items() if k != heat)
    return (np.abs(by_strain - (power - change)) / scale)[clear], (np.abs(by_strain - reduced) / scale)[clear]


def balances(seed: int, count: int) -> dict[str, Any]:
    """Claim 4 for every energy of the library, `count` processes each."""
    rng, found, points = np.random.default_rng(seed), {}, 0
    for name, entry in distinct_energies().items():
        forms, reduced = _balance(entry, rng, count)
        found[name] = {"forms": float(forms.max()), "reduced": float(reduced.max()), "processes": len(forms)}
        points += len(forms)
    return {
        "numbers": {
            "forms": max(f["forms"] for f in found.values()),
            "reduced": max(f["reduced"] for f in found.values()),
            "energies": len(found),
            "processes": points,
            "fewest": min(f["processes"] for f in found.values()),
        },
        "by law": found,
    }


# -- claim 10 -------------------------------------------------------------------------------------------------------------------


def _convolution(values: Any, stress: Array, plastic: Array) -> tuple[float, Array]:
    """Least ψ_s* + ψ_w* over the shares of a stress, without the energies of hardening, and the share of the sand."""
    import cvxpy as cp

    young, poisson, lam_w, mu_w = (values[k] for k in ("E_s", "nu_s", "lambda_w", "mu_w"))
    lam, mu = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
    unit = float(np.abs(stress).max())
    root = np.linalg.cholesky(np.linalg.inv(elasticity(lam / mu, 1.0))).T
    sand, mean = cp.Variable(6), cp.Variable(nonneg=True)
    rest = stress / unit - sand - mean * IDENTITY
    objective = cp.sum_squares(root @ sand) / 2 + (mu / unit) * (plastic @ sand)
    objective += mu / (2 * lam_w) * cp.square(mean) + mu / (4 * mu_w) * cp.sum_squares(rest)
    problem = cp.Problem(cp.Minimize(objective), [as_matrix(rest) >> 0])
    problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-12, tol_gap_rel=1e-12, tol_feas=1e-12)
    return float(problem.value) * unit**2 / mu, np.asarray(sand.value) * unit  # type: ignore[arg-type]


def _shares(rng: np.random.Generator, n: int) -> dict[str, float]:
    """ψ* of `texsol` as the least sum over shares, as a supremum, and certified; and the share of the sand against its own stress."""
    entry = ENTRIES["texsol"]
    numbers, state = Numbers(entry.law, entry.values), random_states(entry, rng, n)
    stress, values = numbers.stress(state), entry.values
    start = state["eps"] + 0.1 * magnitude(entry) * rng.normal(size=(n, 6))
    value, _ = supremum(numbers, stress, state, start)
    rule = partial_conjugate(entry.law)
    (dual,) = rule.duals.values()
    by_rule = rule.value(numbers.values | {v: state[v.name] for v in entry.law.internal} | {dual: stress})
    hardening = values["H_k"] / 2 * dot(state["alpha"], state["alpha"]) + values["H_i"] / 2 * state["p"] ** 2
    own = numbers.force(entry.law.internal[0], state)  # 𝕂_s (ε − ε^p)
    found = {"supremum": 0.0, "rule": 0.0, "share": 0.0}
    for i in range(n):
        least, share = _convolution(values, stress[i], state["eps_p"][i])
        least -= float(hardening[i])
        for key, other in (("supremum", value[i]), ("rule", by_rule[i])):
            found[key] = max(found[key], float(np.nan_to_num(abs(other / least - 1), nan=np.inf)))
        found["share"] = max(found["share"], float(np.abs(share - own[i]).max() / np.abs(stress[i]).max()))
    return found


def _sums(rng: np.random.Generator, n: int) -> dict[str, float]:
    """Compiled steps: stress of the phases together against the sum of the phases alone at the same strain, and the growth of p."""
    values = ENTRIES["texsol"].values
    strains = corners(ENTRIES["texsol"], rng, n, 1)
    lam, mu = values["lambda_w"], values["mu_w"]
    sand = ENTRIES["sand"].law.compile()(strains, None, **{k: v for k, v in values.items() if not k.endswith("_w")})
    wires = ENTRIES["wire"].law.compile()(strains, None, lambda_w=lam, mu_w=mu).stress
    rods = ENTRIES["linear_elastic"].law.compile()(
        strains, None, E=mu * (3 * lam + 2 * mu) / (lam + mu), nu=lam / (2 * (lam + mu))
    )
    found = {}
    for name, alone in (("texsol", wires), ("reinforced_sand", rods.stress)):
        out = ENTRIES[name].law.compile()(strains, None, **values)
        apart = size_of(out.stress - sand.stress - alone) / (size_of(sand.stress) + size_of(alone))
        flow = np.abs(out.state["p"] - sand.state["p"]).max() / sand.state["p"].max()
        found[name] = max(float(apart.max()), float(flow))
    return found | {"plastic": float((sand.state["p"] > 0).mean())}


def superposition(seed: int, count: int, programs: int) -> dict[str, Any]:
    """Claim 10: `count` strains, and `programs` stresses shared out by a semidefinite program."""
    rng = np.random.default_rng(seed)
    sums, shares = _sums(rng, count), _shares(rng, programs)
    numbers = {
        "sums": max(sums["texsol"], sums["reinforced_sand"]),
        "plastic": sums["plastic"],
        "shares": max(shares["supremum"], shares["rule"]),
        "share": shares["share"],
        "strains": count,
        "programs": programs,
    }
    return {"numbers": numbers, "by law": {"sums": sums, "shares": shares}}
