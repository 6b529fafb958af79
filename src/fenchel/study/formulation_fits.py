"""The fits behind the choice of a formulation: all costs of `cost_functions`, on planted data and on records of grains.

Planted data: the law itself makes triaxial tests with a reversal into extension, on a path seven times finer than what is fitted (implicit
Euler is exact on both, as the flow has one direction on every leg), without and with normal noise on every component: on the stress
relative to the confining pressure, on the strain relative to 1e-3. Strains count from the first frame and the confining pressure is known,
so the first frame has no noise. Data of grains: samples and pressures are left out of the fit in turn and predicted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dem.run import load_record
from ..errors import ConvergenceError, InputError
from ..identify.curves import Curves, curves, thin
from ..identify.elastic import elastic_moduli
from ..identify.hardening import misfit_of
from ..identify.interval import jackknife_deviation
from ..identify.options import IdentifyOptions
from ..identify.parameters import LawParameters
from ..identify.replay import replay
from ..identify.yielding import fit_yield
from .cost_functions import COSTS, FREE, NAMES, Fit, Measured, Problem, fit, measured, plastic_path, values_by_name
from .identification_runs import GRAINS, TABLE_3, planted_tests

__all__ = ["NOISES", "SETS", "choice_of", "discrete_choice", "planted_choice"]

Array = NDArray[np.float64]
SETS = {"table_3": TABLE_3, "grains": GRAINS}
PRESSURES = (5e4, 9e4)
NOISES = {
    "stress 1 %": (0.01, 0.0), "strain 1 %": (0.0, 0.01), "both 0.5 %": (0.005, 0.005), "both 1 %": (0.01, 0.01), "both 2 %": (0.02, 0.02),
}  # fmt: skip
FRAMES = 120


# -- planted data -----------------------------------------------------------------------------------------------------------------


def _noisy(tests: Sequence[Curves], noise: tuple[float, float], seed: int) -> list[Curves]:
    """The tests with noise from the second frame on: the same for every cost and, up to its size, every noise."""
    out = []
    for k, test in enumerate(tests):
        draws = np.random.default_rng([31, seed, k]).normal(size=(2, *test.total.shape))
        draws[:, 0] = 0.0
        stress, strain = noise[0] * test.pressure * draws[0], noise[1] * 1e-3 * draws[1]
        out.append(replace(test, total=test.total + stress, strain=test.strain + strain))
    return out


def _row(found: Fit, truth: LawParameters, names: Sequence[str]) -> dict[str, Any]:
    known = values_by_name(truth, names)
    failed = bool(found.failure)
    return {
        "error": np.full(len(names), np.nan) if failed else values_by_name(found.law, names) / known - 1.0, "half": found.half / known,
        "misfit": found.misfit, "condition": found.condition, "evaluations": found.evaluations, "law_steps": found.law_steps,
        "refused": found.refused, "failed": failed,
    }  # fmt: skip


def _stacked(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


def planted_choice(name: str, cost: str, seeds: int, frames: int = FRAMES) -> dict[str, Any]:
    """Fits of one cost to planted data of one set: without noise, and under every noise for `seeds` seeds; errors and half-widths relative.

    At the planted parameters: "gain", the misfit over the noise of what drives the law; "drift", the share of p at the end of the path that
    the noise has added; and the misfit of a law that does not harden.
    """
    law = SETS[name]
    clean = [thin(test, frames) for test in planted_tests(law, PRESSURES)]
    exact = [measured(test) for test in clean]
    straight = [plastic_path(law, test, cost) for test in exact]
    out: dict[str, Any] = {"kind": "planted", "set": name, "cost": cost, "seeds": seeds, "noise": {}}
    out["clean"] = _row(fit(cost, exact, law), law, NAMES)
    out["clean, E_s free"] = _row(fit(cost, exact, law, names=FREE), law, FREE)
    for label, noise in NOISES.items():
        rows = []
        for seed in range(seeds):
            tests = [measured(test) for test in _noisy(clean, noise, seed)]
            drift = np.mean([plastic_path(law, test, cost) / p - 1.0 for test, p in zip(tests, straight, strict=True)])
            driver = _driver_noise(exact, tests, cost)
            gain = Problem(cost, tests, law, NAMES).misfit(law) / driver if driver > 0.0 else float("nan")
            rows.append(_row(fit(cost, tests, law), law, NAMES) | {"drift": float(drift), "gain": gain})
        out["noise"][label] = _stacked(rows)
    few = [[measured(test) for test in _noisy(clean, NOISES["both 1 %"], seed)] for seed in range((seeds + 1) // 2)]
    out["both 1 %, E_s free"] = _stacked([_row(fit(cost, tests, law, names=FREE), law, FREE) for tests in few])
    soft = replace(law, H_k=1e-7 * law.E_s, H_i=0.0)
    try:
        out["no hardening"] = Problem(cost, exact, law, NAMES).misfit(soft)
    except ConvergenceError as error:
        out["no hardening"], out["stops"] = float("inf"), str(error)
    return out


def _driver_noise(exact: Sequence[Measured], tests: Sequence[Measured], cost: str) -> float:
    """Noise of what drives the law, root mean square relative to its largest value."""
    parts = []
    for a, b in zip(exact, tests, strict=True):
        stress = np.mean(((b.stress - a.stress) ** 2).sum(axis=1)) / b.largest_q**2
        strain = np.mean(((b.strain - a.strain) ** 2).sum(axis=1)) / b.largest_strain**2
        parts.append(stress if cost == "stress" else strain)
    return float(np.sqrt(np.mean(parts)))


# -- data of grains ---------------------------------------------------------------------------------------------------------------


def discrete_choice(
    files: list[str], folder: Path, seed: int, frames: int = FRAMES, noise: float = 0.01, realisations: int = 4
) -> dict[str, Any]:
    """`choice_of` the records of linked tests in run files of a folder."""
    records = [load_record(folder / file) for file in files]
    if not records or not all(record.linked for record in records):
        raise InputError("the choice of a formulation needs records of tests with links, and of these only")
    tests = [curves(record.history()) for record in records]
    return choice_of(tests, [record.seed for record in records], seed, frames, noise, realisations)


def choice_of(
    tests: Sequence[Curves],
    samples: Sequence[int],
    seed: int,
    frames: int = FRAMES,
    noise: float = 0.01,
    realisations: int = 4,
) -> dict[str, Any]:
    """All costs on measured tests, `samples` telling which sample each is of: fits with E_s from small strains and free, each measured by
    all costs; samples and pressures left out in turn; what added noise moves."""
    options = IdentifyOptions()
    kept = [thin(test, frames) for test in tests]
    small = elastic_moduli(tests, options)
    line = fit_yield(tests, small.E_s, small.nu, options)
    base = LawParameters(
        E_s=small.E_s, E_w=small.E_w, nu=small.nu, theta_f=line.theta_f, C_0=max(line.C_0, 1.0), H_k=0.1 * small.E_s, H_i=0.1 * small.E_s
    )  # fmt: skip
    pressures = [test.pressure for test in tests]
    out: dict[str, Any] = {
        "kind": "discrete", "tests": len(tests), "samples": len(set(samples)), "seed": seed, "E_s": base.E_s, "E_w": base.E_w,
        "nu": base.nu, "t_yield": base.t, "C_0_yield": line.C_0, "fits": {}, "E_s free": {},
    }  # fmt: skip
    for cost in COSTS:
        found = _best_fit(cost, kept, base, NAMES)
        free = _best_fit(cost, kept, base, FREE, found.law)
        out["fits"][cost] = _described(found, kept, base, NAMES) | {"q": _q_error(tests, found.law)}
        out["E_s free"][cost] = _described(free, kept, base, FREE) | {"q": _q_error(tests, free.law)}
        for kind, marks in (("sample", list(samples)), ("pressure", pressures)):
            out["fits"][cost][f"left {kind}"] = _left_out(cost, kept, marks, base, found.law)
        draws = [[measured(test) for test in _noisy(kept, (noise, noise), seed + k)] for k in range(realisations)]
        moved = [fit(cost, draw, base, start=found.law).law for draw in draws]
        shift = [values_by_name(law, NAMES) - values_by_name(found.law, NAMES) for law in moved]
        out["fits"][cost]["noise moves"] = np.sqrt(np.mean(np.square(shift), axis=0))
    return out


def _best_fit(
    cost: str, tests: Sequence[Curves], base: LawParameters, names: Sequence[str], *near: LawParameters
) -> Fit:
    """The best of a fit from the guess and one from what is `near` (else `base`), with the counts of both: there are several minima."""
    data = [measured(test) for test in tests]
    found = [fit(cost, data, base, names=names, start=start) for start in (None, *(near or (base,)))]
    best = min(found, key=lambda one: one.misfit if np.isfinite(one.misfit) else np.inf)
    counts = {key: sum(getattr(one, key) for one in found) for key in ("evaluations", "law_steps", "refused")}
    return replace(best, **counts)


def _misfits(tests: Sequence[Curves], law: LawParameters) -> Array:
    """By all costs, in their order; infinite where the law cannot follow."""
    out, data = [], [measured(test) for test in tests]
    for cost in COSTS:
        try:
            out.append(Problem(cost, data, law, NAMES).misfit(law))
        except ConvergenceError:
            out.append(float("inf"))
    return np.array(out)


def _q_error(tests: Sequence[Curves], law: LawParameters) -> float:
    try:
        return misfit_of(tests, law, replay)
    except ConvergenceError:
        return float("inf")


def _described(found: Fit, tests: Sequence[Curves], base: LawParameters, names: Sequence[str]) -> dict[str, Any]:
    return {
        "values": values_by_name(found.law, names), "half": found.half, "measured": _misfits(tests, found.law),
        "condition": found.condition, "evaluations": found.evaluations, "law_steps": found.law_steps, "refused": found.refused,
        "failed": bool(found.failure),
    }  # fmt: skip


def _left_out(
    cost: str, tests: Sequence[Curves], marks: Sequence[Any], base: LawParameters, start: LawParameters
) -> dict[str, Any]:
    """Each mark left out in turn: fits to the rest, from `start`, measured by all costs on what was left out (groups, 4)."""
    levels = sorted(set(marks))
    if len(levels) < 2:
        return {"groups": 0}
    laws, errors = [], []
    for level in levels:
        rest = [measured(test) for test, mark in zip(tests, marks, strict=True) if mark != level]
        out = [test for test, mark in zip(tests, marks, strict=True) if mark == level]
        found = fit(cost, rest, base, start=start)
        laws.append(values_by_name(found.law, NAMES))
        errors.append(_misfits(out, found.law))
    return {
        "groups": len(levels),
        "values": np.array(laws),
        "deviation": jackknife_deviation(laws),
        "measured": np.array(errors),
    }
