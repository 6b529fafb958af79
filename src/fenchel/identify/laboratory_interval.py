"""Intervals of the parameters that were fitted to laboratory tests.

With N = JᵀJ of the weighted residuals, C = N⁻¹ Jᵀ D J N⁻¹ (the sandwich), D their variance channel by channel, times (1 + ρ)/(1 − ρ) for
what follows row upon row with correlation ρ; a Student quantile with as many degrees of freedom as there are independent rows. It is
the interval that the same test on the same specimens would move in, if the law were right. With three files or more the jackknife
over files (delete one) says how much single files move the values; the wider of the two is given.

Source: Seber and Wild 1989 (asymptotic covariance), Quenouille–Tukey jackknife.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, nan, tan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError
from .interval import jackknife_deviation
from .laboratory_file import LaboratoryTest
from .laboratory_problem import LaboratoryProblem

__all__ = ["LaboratoryEstimate", "estimates_of", "leave_one_out"]

Array = NDArray[np.float64]
FILES = 3  # fewer give no jackknife
WITH_EFFECTIVE_HARDENING = ("sand", "reinforced_sand", "texsol")


@dataclass(frozen=True, kw_only=True)
class LaboratoryEstimate:
    """A parameter: `source` of its interval is "residuals", "files", or "none" where it was held or stopped at a bound."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    start: float
    source: str
    deviation_residuals: float  # standard deviation by the residuals; nan without interval
    deviation_files: float  # by the jackknife over files; nan with fewer than three
    note: str = ""


def leave_one_out(
    update: Any,
    tests: Sequence[LaboratoryTest],
    values: Mapping[str, float],
    free: Sequence[str],
    weight: float,
    progress: Callable[[str], None],
) -> list[dict[str, float]]:
    """The values with each file left out in turn, where there are enough of them; a fit that fails is left out."""
    out = []
    for k in range(len(tests) if len(tests) >= FILES and free else 0):
        progress(f"fit without file {k + 1} of {len(tests)}")
        problem = LaboratoryProblem(update, [t for i, t in enumerate(tests) if i != k], values, free, weight)
        try:
            out.append(problem.at(problem.solve()))
        except ConvergenceError:
            continue
    return out


def _covariance(problem: LaboratoryProblem, y: Array, columns: Array, free: NDArray[np.bool_]) -> tuple[Array, float]:
    """Sandwich covariance of the scaled unknowns in `free`, and the degrees of freedom of its quantile."""
    residual, jacobian = problem.residual(y), columns[:, free]
    normal = np.linalg.inv(jacobian.T @ jacobian)
    inside, independent = np.zeros_like(normal), 0.0
    share = jacobian.shape[1] / len(residual)
    for piece in problem.pieces():
        r, part = residual[piece], jacobian[piece]
        square = float(r @ r)
        if square <= 0.0:
            independent += len(r)
            continue
        rho = float(np.clip(r[1:] @ r[:-1] / square, 0.0, 0.98))
        spread = (1.0 + rho) / (1.0 - rho)
        inside += spread * square / (len(r) * (1.0 - share)) * part.T @ part
        independent += len(r) / spread
    return normal @ inside @ normal, max(independent - jacobian.shape[1], 1.0)


def estimates_of(
    law: Any,
    law_name: str,
    problem: LaboratoryProblem,
    y: Array,
    columns: Array,
    begin: Mapping[str, float],
    reasons: Mapping[str, str],
    files: Sequence[Mapping[str, float]],
    confidence: float,
) -> dict[str, LaboratoryEstimate]:
    from scipy.stats import t as student

    values = problem.at(y)
    inner = problem.inner(y)
    covariance, freedom = _covariance(problem, y, columns, inner) if inner.any() else (np.zeros((0, 0)), 1.0)
    moving = [name for name, yes in zip(problem.free, inner, strict=True) if yes]
    scale = problem.scale[inner]
    tail = 0.5 + 0.5 * confidence

    def row(
        name: str, unit: str, gradient: Array, value: float, low: float, high: float, of_file: Any
    ) -> LaboratoryEstimate:
        residuals = float(np.sqrt(max(gradient @ covariance @ gradient, 0.0)))
        widths = {"residuals": float(student.ppf(tail, freedom)) * residuals}
        between = nan
        if len(files) >= FILES:
            between = float(jackknife_deviation([of_file(found) for found in files]))
            widths["files"] = float(student.ppf(tail, len(files) - 1)) * between
        source = max(widths, key=lambda key: widths[key])
        return LaboratoryEstimate(
            name=name,
            unit=unit,
            value=value,
            low=max(value - widths[source], low),
            high=min(value + widths[source], high),
            start=begin.get(name, nan),
            source=source,
            deviation_residuals=residuals,
            deviation_files=between,
        )

    out: dict[str, LaboratoryEstimate] = {}
    for symbol in law.parameters:
        name = symbol.name
        if name in moving:
            place = moving.index(name)
            gradient = np.zeros(len(moving))
            gradient[place] = scale[place]
            out[name] = row(
                name,
                symbol.unit,
                gradient,
                values[name],
                symbol.lower,
                symbol.upper,
                lambda found, name=name: found[name],
            )
            continue
        why = reasons.get(name)
        if why is None:
            at = problem.free.index(name)
            why = f"at its {'lower' if y[at] <= 1e-9 else 'upper'} bound: the other intervals hold for this value"
        out[name] = LaboratoryEstimate(
            name=name,
            unit=symbol.unit,
            value=values[name],
            low=nan,
            high=nan,
            start=begin[name],
            source="none",
            deviation_residuals=nan,
            deviation_files=nan,
            note=why,
        )
    if law_name in WITH_EFFECTIVE_HARDENING and {"H_k", "H_i"} & set(moving):
        gradient = np.zeros(len(moving))
        for k, name in enumerate(moving):
            ahead, back = (_effective(values | {name: values[name] + h}) for h in (1e-6 * scale[k], -1e-6 * scale[k]))
            gradient[k] = (ahead - back) / 2e-6
        found = row("H_eff", "Pa", gradient, _effective(values), 0.0, inf, _effective)
        out["H_eff"] = found
    return out


def _effective(values: Mapping[str, float]) -> float:
    """H_eff = H_k(½ + t²/3) + H_i [Pa], what a monotonic test feels."""
    return values["H_k"] * (0.5 + tan(values["theta_f"]) ** 2 / 3.0) + values["H_i"]
