"""Steps of laws that no reduction takes, by the general engine: points/s with and without tangent, and counts that no machine changes.

NUMBA_NUM_THREADS=1 python benchmarks/bench_general.py [--points N] [--threads K] [NAME ...]

Strains of random direction, amplitudes log-uniform over five decades about the yield strain, every fifth nearly spherical; about half of
the points flow. `newton` and `turns` are means per point, `again` is the share of points that needed another start.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from sympy import Rational, exp, sqrt

from fenchel.integrators.batch import solve_batch
from fenchel.integrators.declared import declared_step
from fenchel.integrators.law_forms import law_forms
from fenchel.integrators.step_program import assemble, flow_of_dual
from fenchel.potentials import (
    Law,
    dev,
    eig_max,
    eig_min,
    eig_sum,
    forces,
    indicator,
    inner,
    isotropic,
    norm,
    parameter,
    parameters,
    pos,
    scalar,
    sym_tensor,
    tr,
)
from fenchel.potentials.library import ENTRIES, LAWS

COUNT, REPEATS = 20_000, 3
I6 = np.array([1.0, 1, 1, 0, 0, 0])
E, NU, YIELD = 12e6, 0.2, 3e3

k, H, a, b, eta, M = parameters("k H a b eta M")
n = parameter("n", lower=0)
eps, eps_p, x1, x2 = sym_tensor("eps"), sym_tensor("eps_p"), sym_tensor("x1"), sym_tensor("x2")
p = scalar("p")
A, X1, X2, R = forces(eps_p, x1, x2, p)
ELASTIC = isotropic(E, NU).energy(eps - eps_p)


def cone_and_cap() -> tuple[Law, dict[str, float]]:
    """Drucker–Prager cone within a ball."""
    cone, ball = norm(dev(A)) / sqrt(2) + a * tr(A) / 3 - k, sqrt(inner(dev(A), dev(A)) / 2 + (tr(A) / 3 + k) ** 2) - b
    law = Law("cone_and_cap", psi=ELASTIC, phi_star=indicator(cone, ball), observable=eps, internal=eps_p)
    return law, dict(a=0.3, k=YIELD, b=1.2 * YIELD)


def cone_cap_planes() -> tuple[Law, dict[str, float]]:
    """The same between two planes; its elastic metric is replaced by an anisotropic one, see `anisotropic`."""
    cone, ball = norm(dev(A)) / sqrt(2) + a * tr(A) / 3 - k, sqrt(inner(dev(A), dev(A)) / 2 + (tr(A) / 3 + k) ** 2) - b
    planes = tr(A) / 3 - k, -tr(A) / 3 - 2 * k
    law = Law("planes", psi=ELASTIC, phi_star=indicator(cone, ball, *planes), observable=eps, internal=eps_p)
    return law, dict(a=0.3, k=YIELD, b=2.5 * YIELD)


def two_back_stresses() -> tuple[Law, dict[str, float]]:
    """One surface, two back-stresses that need not be coaxial."""
    law = Law(
        "two_backs",
        psi=ELASTIC + a / 2 * inner(x1, x1) + b / 2 * inner(x2, x2) + a / 4 * inner(x1, x2),
        phi_star=indicator(norm(dev(A + X1)) + norm(dev(A + X2)) / 2 - k),
        observable=eps,
        internal=(eps_p, x1, x2),
    )
    return law, dict(a=2e6, b=5e6, k=YIELD)


def two_norms() -> tuple[Law, dict[str, float]]:
    """A surface that moves with its back-stress, within a cone that stays."""
    law = Law(
        "two_norms",
        psi=ELASTIC + H / 2 * inner(x1, x1),
        phi_star=indicator(norm(dev(A + X1)) - k, norm(dev(A)) + a * tr(A) - b),
        observable=eps,
        internal=(eps_p, x1),
    )
    return law, dict(H=2e6, k=YIELD, a=0.2, b=1.5 * YIELD)


def mohr_coulomb() -> tuple[Law, dict[str, float]]:
    """Two semidefinite cones."""
    surface = (1 + a) * eig_max(A) - (1 - a) * eig_min(A) - k
    law = Law("mohr_coulomb", psi=ELASTIC, phi_star=indicator(surface), observable=eps, internal=eps_p)
    return law, dict(a=0.5, k=YIELD)


def two_viscous() -> tuple[Law, dict[str, float]]:
    """Powers of two overstresses in different combinations of forces."""
    one, two = (norm(dev(A)) - k) / k, (norm(dev(A + X1)) - k) / k
    law = Law(
        "two_viscous",
        psi=ELASTIC + H / 2 * inner(x1, x1),
        phi_star=k * eta / (n + 1) * pos(one) ** (n + 1) + k * eta / 4 * pos(two) ** 4,
        observable=eps,
        internal=(eps_p, x1),
    )
    return law, dict(H=2e6, k=YIELD, eta=1e-3, n=5.0)


def cam_clay() -> tuple[Law, dict[str, float]]:
    """Modified Cam-Clay as a gauge, with hardening."""
    gauge = sqrt(Rational(3, 2) * inner(dev(A), dev(A)) / M**2 + (tr(A) / 3 + a - R) ** 2) - (a - R)
    law = Law("cam_clay", psi=ELASTIC + H / 2 * p**2, phi_star=indicator(gauge), observable=eps, internal=(eps_p, p))
    return law, dict(H=1e6, a=2 * YIELD, M=1.1)


def saturating() -> tuple[Law, dict[str, float]]:
    """Exponential and power hardening of von Mises."""
    law = Law(
        "saturating",
        psi=ELASTIC + a * (p + b * exp(-p / b)) + H * p ** (n + 1) / (n + 1),
        phi_star=indicator(norm(dev(A)) + R - k),
        observable=eps,
        internal=(eps_p, p),
    )
    return law, dict(a=2 * YIELD, b=1e-3, H=1e5, n=0.4, k=YIELD)


def spectral() -> tuple[Law, dict[str, float]]:
    """Cubic energy of the positive principal strains of the elastic part, with von Mises flow."""
    law = Law(
        "spectral",
        psi=ELASTIC + eig_sum(lambda e: a / 2 * pos(e) ** 2, eps - eps_p),
        phi_star=indicator(norm(dev(A)) - k),
        observable=eps,
        internal=eps_p,
    )
    return law, dict(a=6e6, k=YIELD)


def kelvin_voigt() -> tuple[Law, dict[str, float]]:
    """Of the library."""
    return LAWS["kelvin_voigt"], dict(ENTRIES["kelvin_voigt"].values)


CASES: dict[str, Callable[[], tuple[Law, dict[str, float]]]] = {
    "cone_and_cap": cone_and_cap,
    "anisotropic": cone_cap_planes,
    "two_back_stresses": two_back_stresses,
    "two_norms": two_norms,
    "mohr_coulomb": mohr_coulomb,
    "two_viscous": two_viscous,
    "cam_clay": cam_clay,
    "saturating": saturating,
    "spectral": spectral,
    "kelvin_voigt": kelvin_voigt,
}


def strains(rng: np.random.Generator, count: int, low: float = -6.0, high: float = -1.5) -> np.ndarray:
    """Random strains; the yield strain of the laws above is about 3e-4."""
    found = rng.normal(size=(count, 6)) * 10 ** rng.uniform(low, high, size=(count, 1))
    found[::5] = I6 * found[::5, :1] + 0.02 * found[::5]
    return found


def anisotropic(law: Law, values: dict[str, float], condition: float = 100.0) -> Any:
    """Program of the step of `law` with ½ e:C:e, C of the given condition and random axes, in place of its elastic energy."""
    declared = declared_step(law)
    numbers = {symbol: values[symbol.name] for symbol in law.parameters}
    forms = law_forms(declared, numbers)
    axes = np.linalg.qr(np.random.default_rng(5).normal(size=(6, 6)))[0]
    C = E * (axes * np.geomspace(1.0, 1.0 / condition, 6)) @ axes.T
    size = forms.energy.P.shape[0]
    P = np.zeros((size, size))
    P[:12, :12] = np.block([[C, -C], [-C, C]])
    return assemble(replace(forms.energy, P=P), flow_of_dual(forms.flow, 1.0), forms.moved, 6, False)


def seconds(run: Callable[[], Any], clock: Callable[[], float], repeats: int = REPEATS) -> float:
    """Least time of some repeats."""
    found = []
    for _ in range(repeats):
        start = clock()
        run()
        found.append(clock() - start)
    return min(found)


def runner(name: str, count: int, threads: int) -> tuple[Callable[[bool], Any], Callable[[Any], Any]]:
    """(the step at `count` points with or without tangent, what of its result has the counts)."""
    law, values = CASES[name]()
    eps_new = strains(np.random.default_rng(1), count)
    more = {"threads": threads} if threads > 1 else {}
    if name == "anisotropic":
        program = anisotropic(law, values)
        data = np.ascontiguousarray(np.hstack([eps_new, np.zeros((count, 6))]))
        return lambda tangent: solve_batch(program, data, tangent=tangent, **more), lambda found: found
    update = law.compile(solver="general")
    if more:
        update = replace(update, **more)
    old = update.packing.pack(None, count)
    numbers, heat = update.arguments(values, count)
    return (
        lambda tangent: update.solve(eps_new, old, 1.0, numbers, heat, tangent=tangent),
        lambda solution: solution.parts[0].found,
    )


def main() -> None:
    """Print one line per law."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(CASES))
    parser.add_argument("--points", type=int, default=COUNT)
    parser.add_argument("--threads", type=int, default=1)
    given = parser.parse_args()
    clock = time.process_time if given.threads == 1 else time.perf_counter
    for name in given.names:
        run, engine = runner(name, given.points, given.threads)
        found = engine(run(True))
        flows = np.abs(found.y).max(axis=1, initial=0.0) > 1e-13 * np.abs(found.multipliers).max(axis=1, initial=1.0)
        with_tangent, without = seconds(lambda: run(True), clock), seconds(lambda: run(False), clock)  # noqa: B023
        print(
            f"{name:18s} unknowns {found.y.shape[1]:2d} rows {found.multipliers.shape[1]:2d}  "
            f"with tangent {given.points / with_tangent / 1e3:7.1f} k/s  without {given.points / without / 1e3:7.1f} k/s  "
            f"flowing {flows.mean():.2f}  newton {found.counts.mean():5.2f} (most {found.counts.max()})  "
            f"turns {found.turns.mean():4.2f}  again {100 * (found.attempts > 1).mean():.3f} %  "
            f"failed {(found.status > 1).sum()}  residual {found.residual.max():.0e}"
        )


if __name__ == "__main__":
    main()
