"""Kinematic and isotropic hardening: the law run along the tests, its parameters fitted to q(ε_zz) over the whole path.

Minimise over the fitted tests i (each with the same weight)

    J = Σ_i (1/n_i) Σ_k [(q_law,i(ε_k) − q_i,k)/max|q_i|]²,        H_k, H_i, C_0, t ≥ 0,

by a Gauss–Newton method with bounds. "Staged": (H_k, H_i) with t and C_0 from the yield line. "Joint": (t, C_0, H_k, H_i)
from there, with E_s, E_w and ν kept; a last fit with E_s free as well says what the small-strain modulus costs. Only q is
fitted: the flow is associated, dilates from first yield, and cannot follow the volume.

On a monotonic leg the law feels H_k and H_i only through H_eff = H_k(½ + t²/3) + H_i, so the columns ∂q/∂H_k and ∂q/∂H_i are
parallel (ratio ½ + t²/3). A reversal that reaches plastic flow in extension parts them. The condition number of these two
raw columns at the fitted point decides: above the limit one number is fitted, H_eff (carried by H_k alone, H_i = 0), and
the two are marked as not separable.

At one pressure, on one leg, P_s = P + √J₂/√3 makes (1, P_s, p) linearly dependent: only pressures that differ, or a reversal, part
friction from cohesion and hardening. The condition number of the columns of (t, C_0, H_i), each of length one, says by how much the
scatter of the data is blown up; some per cent of it times `YIELD_LIMIT` is all there is. Beyond, C_0 ends at its bound in every replica,
and the others would have narrow intervals around wrong values: none has one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError
from .bounded_fit import bounded_least_squares
from .curves import Curves, deviator, thin
from .elastic import ElasticFit
from .options import IdentifyOptions
from .parameters import LawParameters
from .replay import Simulate
from .yielding import YieldFit, effective_hardening

__all__ = ["HardeningFit", "Stage", "fit_hardening", "misfit_of", "sensitivity"]

Array = NDArray[np.float64]
YIELD_LIMIT = 30.0  # of the condition number of the unit columns of (t, C_0, H_i)
MAX_SLOPE = 1.6  # t above this leaves almost no yield in triaxial compression (none at √3)


@dataclass(frozen=True, kw_only=True)
class Stage:
    """One fitted set: values, rms misfit of q / max|q| over the tests, condition number of (H_k, H_i), bounds met."""

    parameters: LawParameters
    H_eff: float
    misfit: float
    condition: float  # of the raw columns ∂q/∂H_k, ∂q/∂H_i at this point
    column_ratio: float  # ⟨∂q/∂H_k, ∂q/∂H_i⟩/‖∂q/∂H_i‖²; ½ + t²/3 when they are parallel
    separable: bool
    at_bound: tuple[str, ...]
    evaluations: int


@dataclass(frozen=True, kw_only=True)
class HardeningFit:
    """Both columns of the report and the sensitivity at the joint point."""

    staged: Stage
    joint: Stage
    free_stiffness: Stage | None  # E_s fitted as well: what the small-strain modulus costs; never exported
    names: tuple[str, ...]  # columns of the sensitivity matrix
    singular_values: tuple[float, ...]  # of the raw columns, all tests stacked
    hardening_singular_values: tuple[float, ...]  # of the block (H_k, H_i)
    yield_condition: float  # of the columns of (t, C_0, H_i), each of length one

    @property
    def separable(self) -> bool:
        """Whether H_k and H_i are told apart by the data."""
        return self.joint.separable

    @property
    def yield_separable(self) -> bool:
        """Whether friction, cohesion and hardening are told apart by the data."""
        return self.yield_condition <= YIELD_LIMIT


def _with(base: LawParameters, **changes: float) -> LawParameters:
    values = base.to_json()
    if "t" in changes:
        changes["theta_f"] = float(np.arctan(changes.pop("t")))
    return LawParameters(**{**values, **changes})


class _Problem:
    """Residuals of q over the tests for a set of free parameters."""

    def __init__(self, tests: Sequence[Curves], simulate: Simulate) -> None:
        self.tests = tests
        self.simulate = simulate
        self.evaluations = 0

    def q(self, parameters: LawParameters) -> list[Array]:
        """q [Pa] of the law along every test, less its start."""
        self.evaluations += 1
        out = []
        for test in self.tests:
            run = deviator(
                self.simulate(parameters, test.lateral_pressure, test.axial_strain - test.axial_strain[0]).stress
            )
            if not np.all(np.isfinite(run)):
                raise ConvergenceError(f"the law gives no finite stress at {test.pressure:g} Pa with {parameters}")
            out.append(run - run[0])
        return out

    def residual(self, parameters: LawParameters) -> Array:
        """Stacked (q_law − q)/(max|q| √n)."""
        return np.concatenate(
            [
                (run - test.q) / (np.max(np.abs(test.q)) * len(run) ** 0.5)
                for run, test in zip(self.q(parameters), self.tests, strict=True)
            ]
        )

    def misfit(self, parameters: LawParameters) -> float:
        """rms over the tests of their rms/max|q|."""
        return float(np.sqrt(np.sum(self.residual(parameters) ** 2) / len(self.tests)))


def misfit_of(tests: Sequence[Curves], parameters: LawParameters, simulate: Simulate) -> float:
    """rms of q_law − q over the tests, each relative to its largest |q|."""
    return _Problem(tests, simulate).misfit(parameters)


def sensitivity(
    tests: Sequence[Curves], parameters: LawParameters, names: Sequence[str], simulate: Simulate, *, step: float = 1e-3
) -> Array:
    """Raw columns ∂q/∂x for `names` (of t, C_0, H_k, H_i), all tests stacked, shape (point_count, len(names)).

    Central differences; one-sided of second order where a value is too near zero. The steps of H_k and H_i move H_eff equally,
    so that their truncation errors do not part parallel columns.
    """
    problem = _Problem(tests, simulate)
    base = {"t": parameters.t, "C_0": parameters.C_0, "H_k": parameters.H_k, "H_i": parameters.H_i}
    half = 0.5 + parameters.t**2 / 3.0
    reach = step * max(effective_hardening(parameters.H_k, parameters.H_i, parameters.t), 1e-4 * parameters.E_s)
    steps = {
        "t": step * max(parameters.t, 0.05),
        "C_0": step * max(parameters.C_0, 100.0),
        "H_k": reach / half,
        "H_i": reach,
    }
    one_sided = any(base[name] < steps[name] for name in names if name in ("H_k", "H_i"))

    def run(name: str, value: float) -> Array:
        return np.concatenate(problem.q(_with(parameters, **{name: value})))

    centre = (
        np.concatenate(problem.q(parameters))
        if one_sided or base["t"] < steps["t"] or base["C_0"] < steps["C_0"]
        else None
    )
    columns = []
    for name in names:
        x, h = base[name], steps[name]
        if (one_sided and name in ("H_k", "H_i")) or x < h:
            assert centre is not None
            columns.append((4.0 * run(name, x + h) - run(name, x + 2.0 * h) - 3.0 * centre) / (2.0 * h))
        else:
            columns.append((run(name, x + h) - run(name, x - h)) / (2.0 * h))
    return np.stack(columns, axis=1)


def _stage(
    problem: _Problem,
    parameters: LawParameters,
    simulate: Simulate,
    limit: float,
    at_bound: tuple[str, ...],
    tied: bool,
) -> Stage:
    block = sensitivity(problem.tests, parameters, ("H_k", "H_i"), simulate)
    singular = np.linalg.svd(block, compute_uv=False)
    condition = float(singular[0] / singular[1]) if singular[1] > 0 else float("inf")
    square = float(block[:, 1] @ block[:, 1])
    return Stage(
        parameters=parameters,
        H_eff=effective_hardening(parameters.H_k, parameters.H_i, parameters.t),
        misfit=problem.misfit(parameters),
        condition=condition,
        column_ratio=float(block[:, 0] @ block[:, 1]) / square if square > 0 else float("nan"),
        separable=condition <= limit and not tied,
        at_bound=at_bound,
        evaluations=problem.evaluations,
    )


def _fit(
    problem: _Problem, start: LawParameters, free_yield: bool, tied: bool, level: float, *, stiffness: bool = False
) -> tuple[LawParameters, tuple[str, ...]]:
    """Least squares over (t, C_0 if `free_yield`) and (H_k, H_i), or H_eff alone if `tied` (all of it in H_k); E_s too if `stiffness`."""
    hard = max(effective_hardening(start.H_k, start.H_i, start.t), 0.02 * start.E_s)
    names = (("theta_f", "C_0") if free_yield else ()) + (("H_eff",) if tied else ("H_k", "H_i"))
    names += ("E_s",) if stiffness else ()
    begin = {"theta_f": start.t, "C_0": start.C_0, "H_k": start.H_k, "H_i": start.H_i, "H_eff": hard, "E_s": start.E_s}
    scale = {"theta_f": 0.3, "C_0": 0.1 * level, "H_k": hard, "H_i": hard, "H_eff": hard, "E_s": start.E_s}
    top = {
        "theta_f": MAX_SLOPE,
        "C_0": 10.0 * level,
        "H_k": 10.0 * start.E_s,
        "H_i": 10.0 * start.E_s,
        "H_eff": 10.0 * start.E_s,
        "E_s": 10.0 * start.E_s,
    }

    def unpack(x: Array) -> LawParameters:
        values = dict(zip(names, np.maximum(x, 0.0).tolist(), strict=True))
        t = values.get("theta_f", start.t)
        floor = 1e-7 * start.E_s  # keeps the limit load regular; a value there counts as zero
        H_k = max(values["H_eff"] / (0.5 + t * t / 3.0) if tied else values["H_k"], floor)
        H_i = 0.0 if tied else values["H_i"]
        return _with(
            start,
            t=t,
            C_0=max(values.get("C_0", start.C_0), 1e-6 * level),
            H_k=H_k,
            H_i=H_i,
            E_s=max(values.get("E_s", start.E_s), 0.02 * start.E_s),
        )

    def pick(table: dict[str, float]) -> Array:
        return np.array([table[name] for name in names])

    units = pick(scale)
    y = bounded_least_squares(lambda v: problem.residual(unpack(v * units)), pick(begin) / units, pick(top) / units)
    y = np.where(y <= 1e-6, 0.0, y)
    return unpack(y * units), tuple(name for name, value in zip(names, y, strict=True) if value == 0.0)


def _unit_condition(columns: Array) -> float:
    """Condition number of columns divided by their lengths; infinite where one vanishes."""
    lengths = np.linalg.norm(columns, axis=0)
    if not (lengths > 0.0).all():
        return float("inf")
    singular = np.linalg.svd(columns / lengths, compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 0.0 else float("inf")


def fit_hardening(
    tests: Sequence[Curves],
    elastic: ElasticFit,
    yielding: YieldFit,
    options: IdentifyOptions,
    simulate: Simulate,
    *,
    start: HardeningFit | None = None,
) -> HardeningFit:
    """Staged and joint hardening of the fitted tests; `start`: a neighbouring fit to begin from (octant replicas).

    Raises `ConvergenceError` when a fit or the law itself does not converge.
    """
    thinned = [thin(test, options.fit_frames) for test in tests]
    level = float(np.mean([test.pressure for test in tests]))
    half = 0.5 + yielding.t**2 / 3.0
    base = LawParameters(
        E_s=elastic.E_s,
        E_w=elastic.E_w,
        nu=elastic.nu,
        theta_f=yielding.theta_f,
        C_0=max(yielding.C_0, 1e-6 * level),
        H_k=0.5 * yielding.H_eff / half,
        H_i=0.5 * yielding.H_eff,
    )
    problem = _Problem(thinned, simulate)
    if start is None:
        splits = [_with(base, H_k=s * yielding.H_eff / half, H_i=(1.0 - s) * yielding.H_eff) for s in (0.1, 0.5, 0.9)]
        first = min(splits, key=problem.misfit)
        tied = False
    else:
        near = start.staged.parameters
        first, tied = _with(base, H_k=near.H_k, H_i=near.H_i), not start.staged.separable
    values, bound = _fit(problem, first, False, tied, level)
    staged = _stage(problem, values, simulate, options.condition_limit, bound, tied)
    if not staged.separable and not tied:
        condition, ratio = staged.condition, staged.column_ratio
        values, bound = _fit(problem, first, False, True, level)
        staged = _stage(problem, values, simulate, options.condition_limit, bound, True)
        staged = Stage(**{**vars(staged), "condition": condition, "column_ratio": ratio})

    problem = _Problem(thinned, simulate)
    if start is not None:
        near = start.joint.parameters
        begin = _with(base, theta_f=near.theta_f, C_0=near.C_0, H_k=near.H_k, H_i=near.H_i)
        tied = not start.joint.separable
    else:
        begin, tied = staged.parameters, not staged.separable
    values, bound = _fit(problem, begin, True, tied, level)
    joint = _stage(problem, values, simulate, options.condition_limit, bound, tied)
    if not joint.separable and not tied:
        condition, ratio = joint.condition, joint.column_ratio
        values, bound = _fit(problem, begin, True, True, level)
        joint = _stage(problem, values, simulate, options.condition_limit, bound, True)
        joint = Stage(**{**vars(joint), "condition": condition, "column_ratio": ratio})
    free = None
    if start is None:
        values, bound = _fit(problem, joint.parameters, True, not joint.separable, level, stiffness=True)
        free = _stage(problem, values, simulate, options.condition_limit, bound, not joint.separable)
    names = ("t", "C_0", "H_k", "H_i")
    matrix = sensitivity(thinned, joint.parameters, names, simulate)
    return HardeningFit(
        staged=staged,
        joint=joint,
        free_stiffness=free,
        names=names,
        singular_values=tuple(float(v) for v in np.linalg.svd(matrix, compute_uv=False)),
        hardening_singular_values=tuple(float(v) for v in np.linalg.svd(matrix[:, 2:], compute_uv=False)),
        yield_condition=_unit_condition(matrix[:, [0, 1, 3]]),
    )
