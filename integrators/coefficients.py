"""The numbers through which a law enters the compiled steps: places in the state, and coefficients as expressions in parameters, dt and T.

`closed_numbers` lays them out for `kernels.closed_text`, `reduced_numbers` for `kernels.reduced_text`; what integers and groups mean stands
there.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from sympy import Expr, S

from . import plan
from .declared import state_layout
from .reduced_structure import Q, Reduction, is_curved
from .structure import internal_scalars, internal_tensors

__all__ = ["Numbers", "closed_numbers", "is_closed", "is_single", "reduced_numbers", "strain_numbers"]

Group = tuple[str, list[Expr]]


@dataclass
class Numbers:
    """`plan` and the groups of coefficients, each with one line that says what it is."""

    plan: list[int] = field(default_factory=list)
    groups: list[Group] = field(default_factory=list)

    @property
    def size(self) -> int:
        """Number of coefficients so far."""
        return sum(len(group) for _, group in self.groups)

    def add(self, what: str, *entries: Expr) -> int:
        """Append a group; returns where it begins."""
        start = self.size
        if entries:
            self.groups.append((what, list(entries)))
        return start


def is_closed(reduction: Reduction) -> bool:
    """True if the step has the closed form: at most one surface, affine, in one norm, traces and scalars."""
    return reduction.kind == "norm" and reduction.affine and len(reduction.surfaces) <= 1


def is_single(reduction: Reduction) -> bool:
    """True if the projection has one function and a diagonal metric: what `reduced_single` takes."""
    if reduction.kind != "norm" or len(reduction.functions) != 1:
        return False
    block, place = reduction.moduli.scalar_block, {s: j for j, s in enumerate(internal_scalars(reduction.law))}
    coupled = any(block[place[s]][place[r]] != 0 for s in reduction.scalars for r in reduction.scalars if s != r)
    return len(reduction.traces) <= 1 and not coupled


def _combined(weights: tuple[Expr, ...], values: list[Expr]) -> Expr:
    return sum((w * v for w, v in zip(weights, values, strict=True) if w != 0), S.Zero)


def strain_numbers(numbers: Numbers, reduction: Reduction) -> int:
    """Append the coefficients of the unilateral energies of the strain; returns where they begin."""
    moduli = reduction.moduli
    if moduli.rest != 0 or not (moduli.traces or moduli.spectral):
        return numbers.size
    start = numbers.add(
        "energies of the strain: trace terms, spectral terms", S(len(moduli.traces)), S(len(moduli.spectral))
    )
    for w, a, s in moduli.traces:
        numbers.add("w, a, s of w <a tr(eps) + s>^2", w, a, s)
    for w, a, s in moduli.spectral:
        numbers.add("w, a, s of w tr <a eps + s I>^2", w, a, s)
    return start


def closed_numbers(reduction: Reduction, size: int = 6) -> Numbers:
    """Plan and coefficients of a closed step; the places are those of a state with tensors of `size` components."""
    law, moduli = reduction.law, reduction.moduli
    tensors, scalars = internal_tensors(law), internal_scalars(law)
    layout, _ = state_layout(law, size)
    f = reduction.surfaces[0] if reduction.surfaces else S.NegativeOne
    slope = {z: f.diff(z) for z in reduction.unknowns}
    a = slope.get(Q, S.Zero)
    n = len(tensors)
    traces = [z for z in reduction.unknowns if str(z).startswith("t")]
    trace_weights = tuple(
        sum((slope[t] * b[k] for t, b in zip(traces, reduction.traces, strict=True)), S.Zero) for k in range(n)
    )
    weights = reduction.weights
    c0 = [[p[0] for p in row] for row in moduli.tensors]
    mean = [[p[0] + 3 * p[1] for p in row] for row in moduli.tensors]
    r = {s: slope[law.forces[s]] for s in reduction.scalars}
    at_zero = f.xreplace(dict.fromkeys(reduction.unknowns, S.Zero))
    place = {s: j for j, s in enumerate(scalars)}
    start = at_zero + 3 * _combined(trace_weights, list(moduli.force_0))
    rows = []
    for s in scalars:
        rows.append(-sum((w * moduli.scalar_block[place[x]][place[s]] for x, w in r.items()), S.Zero))
    for x, w in r.items():
        start = start + w * _constant(moduli.slopes[place[x]], scalars)
    w_q = sum((weights[k] * _combined(weights, c0[k]) for k in range(n)), S.Zero)
    w_t = 3 * sum((trace_weights[k] * _combined(trace_weights, mean[k]) for k in range(n)), S.Zero)
    w_r = sum((w * v * moduli.scalar_block[place[x]][place[y]] for x, w in r.items() for y, v in r.items()), S.Zero)
    g_q = -_combined(weights, [p[0] for p in moduli.mixed])
    g_t = -_combined(trace_weights, [p[0] + 3 * p[1] for p in moduli.mixed])
    numbers = Numbers()
    numbers.add("a, w_q, w_m", a, w_q, w_t + w_r)
    numbers.add("g_q, g_T, f at zero, k", g_q, g_t, start, -at_zero)
    numbers.add("stiffness pair, stress at zero", *moduli.strain, moduli.stress_0)
    for k, x in enumerate(tensors):
        numbers.add(
            f"{x}: k_B, k_T, a, b, moduli pair",
            -_combined(weights, [row[k] for row in c0]),
            -_combined(trace_weights, [row[k] for row in mean]),
            weights[k],
            trace_weights[k],
            *moduli.mixed[k],
        )
    for s, row in zip(scalars, rows, strict=True):
        numbers.add(f"{s}: k_s, r", row, r.get(s, S.Zero))
    strain_numbers(numbers, reduction)
    numbers.plan = [n, len(scalars), int(bool(reduction.moduli.alone))]
    numbers.plan += [layout[v.name][0] for v in (*tensors, *scalars)]
    return numbers


def _constant(slope: Expr, scalars: tuple[Expr, ...]) -> Expr:
    return slope.xreplace(dict.fromkeys(scalars, S.Zero))


def reduced_numbers(reduction: Reduction, size: int = 6) -> Numbers:
    """Plan and coefficients of a reduced step, without those of the method's own functions."""
    law, moduli = reduction.law, reduction.moduli
    tensors, scalars = internal_tensors(law), internal_scalars(law)
    layout, _ = state_layout(law, size)
    n = len(tensors)
    weights = reduction.weights
    c0 = [[p[0] for p in row] for row in moduli.tensors]
    c1 = [[p[1] for p in row] for row in moduli.tensors]
    mean = [[p[0] + 3 * p[1] for p in row] for row in moduli.tensors]
    numbers = Numbers()
    numbers.add("stiffness pair, stress at zero", *moduli.strain, moduli.stress_0)
    mixed0, mixed1 = [p[0] for p in moduli.mixed], [p[1] for p in moduli.mixed]
    numbers.add(
        "B of eps (pair), B at zero",
        -_combined(weights, mixed0),
        -_combined(weights, mixed1),
        _combined(weights, list(moduli.force_0)),
    )
    for k, x in enumerate(tensors):
        numbers.add(
            f"{x}: B of it (pair), moduli pair, a",
            -_combined(weights, [row[k] for row in c0]),
            -_combined(weights, [row[k] for row in c1]),
            *moduli.mixed[k],
            weights[k],
        )
    trace_start = numbers.size
    for i, b in enumerate(reduction.traces):
        entries = [-_combined(b, [p[0] + 3 * p[1] for p in moduli.mixed]), 3 * _combined(b, list(moduli.force_0))]
        for k in range(n):
            entries += [-_combined(b, [row[k] for row in mean]), b[k]]
        numbers.add(f"trace {i}: of tr(eps), at zero, then of the trace of every tensor and its b", *entries)
    scalar_start = numbers.size
    place = {s: j for j, s in enumerate(scalars)}
    quadratic = moduli.quadratic
    for s in reduction.scalars:
        j = place[s]
        entries = [-h if quadratic else S.Zero for h in moduli.scalar_block[j]]
        numbers.add(
            f"force of {s}: at zero, then of every scalar",
            _constant(moduli.slopes[j], scalars) if quadratic else S.Zero,
            *entries,
        )
    metric = numbers.add(f"metric W, {len(reduction.unknowns)} rows", *_metric(reduction, c0, c1, mean, place))
    flags = {
        plan.KIND: reduction.kind == "principal",
        plan.TENSORS: n,
        plan.SCALARS: len(scalars),
        plan.UNKNOWNS: len(reduction.unknowns),
        plan.TRACES: len(reduction.traces),
        plan.MOVING: len(reduction.scalars),
        plan.NORM: reduction.has_norm,
        plan.TRACE_START: trace_start,
        plan.SCALAR_START: scalar_start,
        plan.FROZEN: len(reduction.frozen_scalars),
        plan.STRAIN: bool(moduli.alone),
        plan.SURFACES: len(reduction.functions),
        plan.ORDERS: len(reduction.order_rows),
        plan.SOFT: reduction.soft is not None,
        plan.VISCOUS: reduction.finite != 0,
        plan.CURVED: is_curved(reduction),
        plan.NONLINEAR: not quadratic,
        plan.FIRST_SCALAR: reduction.first_scalar,
        plan.METRIC: metric,
        plan.LINES: numbers.size,
    }
    numbers.plan = [int(flags.get(i, 0)) for i in range(plan.PLACES)]
    places = [layout[v.name][0] for v in (*tensors, *scalars, *reduction.scalars)]
    numbers.plan += places + [layout[v.variable.name][0] for v in reduction.frozen_scalars]
    return numbers


def _metric(
    reduction: Reduction, c0: list[list[Expr]], c1: list[list[Expr]], mean: list[list[Expr]], place: dict[Expr, int]
) -> list[Expr]:
    n, weights = len(reduction.unknowns), reduction.weights
    m = range(len(weights))
    matrix = [[S.Zero for _ in range(n)] for _ in range(n)]
    own = sum((weights[k] * _combined(weights, c0[k]) for k in m), S.Zero)
    if reduction.kind == "principal":
        common = sum((weights[k] * _combined(weights, c1[k]) for k in m), S.Zero)
        for i in range(3):
            for j in range(3):
                matrix[i][j] = common + (own if i == j else S.Zero)
    else:
        first = int(reduction.has_norm)
        if first:
            matrix[0][0] = own
        for i, b in enumerate(reduction.traces):
            for j, d in enumerate(reduction.traces):
                matrix[first + i][first + j] = 3 * sum((b[k] * _combined(d, mean[k]) for k in m), S.Zero)
    start = reduction.first_scalar
    if reduction.moduli.quadratic:
        for i, s in enumerate(reduction.scalars):
            for j, r in enumerate(reduction.scalars):
                matrix[start + i][start + j] = reduction.moduli.scalar_block[place[s]][place[r]]
    return [e for row in matrix for e in row]
