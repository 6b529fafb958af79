"""Certified numbers of a conjugate: a lower and an upper bound of sup over x of y·x − F(x).

The lower bound is y·x − F(x) itself at the x that is found, evaluated apart from the solver. The upper bound is the Lagrange dual of the
conic form min ½ vᵀPv + qᵀv, Av + s = b, s ∈ K, which holds for every z ∈ K*:

    ½ vᵀPv + qᵀv ≥ −½ v̂ᵀPv̂ − bᵀz + rᵀv,   r = Pv̂ + q + Aᵀz,

with |rᵀv| ≤ ‖r‖₁ ‖v‖_∞ for v up to ten times as long as v̂. Their difference is the gap.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sympy import Float

from ...errors import ConvergenceError, DeclarationError, InputError
from ..atoms import atom_of
from ..atoms.atom import Invariant
from ..atoms.norm import NormLeaf
from ..derivative import partial
from ..evaluate import evaluate
from ..extended import Extended, as_extended
from ..ranked import Ranked
from ..scalars import ScalarVariable
from ..tensor import TensorSymbol
from ..vector import VectorSymbol

if TYPE_CHECKING:
    from .conjugate import Conjugate

__all__ = ["NumericalConjugate", "conjugate_arguments", "conjugate_values", "numerical_conjugate"]

REACH = 10.0
SOLVER = 1e-10
AT_REST = 1e-2


@dataclass(frozen=True)
class NumericalConjugate:
    """`value` of F* (+∞ if the supremum is), its `argument` by variable (an element of ∂F*), and `gap`: F* lies in [value, value + gap].

    An infinite value rests on the solver's ray along which y·x − F(x) grows without bound; its argument is empty.
    """

    value: float
    argument: dict[Any, Any]
    gap: float


def numerical_conjugate(
    function: Any,
    variables: Any,
    at: Mapping[Any, Any],
    values: Mapping[Any, Any] | None = None,
    *,
    tolerance: float = 1e-6,
) -> NumericalConjugate:
    """F*(y) of a convex `function` (expression, `indicator(...)` or their sum) over `variables`, at the duals `at`, by variable.

    `at` holds components (6,) Mandel, (3,) or a number; `values` the numbers of parameters and other data, by symbol. Raises
    `ConvergenceError` if the gap exceeds `tolerance` times 1 + |value| in the units of the value, and `DeclarationError` for what has no
    conic form and is not smooth.

    >>> from fenchel.potentials import inner, sym_tensor
    >>> eps = sym_tensor("eps")
    >>> found = numerical_conjugate(2 * inner(eps, eps), eps, {eps: [4.0, 0, 0, 0, 0, 0]})
    >>> round(found.value, 6), found.gap < 1e-6
    (2.0, True)
    """
    import numpy as np

    potential = as_extended(function, "numerical_conjugate")
    slots = tuple(variables) if isinstance(variables, (tuple, list)) else (variables,)
    missing = [str(v) for v in slots if v not in at]
    if missing:
        raise InputError(f"numerical_conjugate: no dual is given for {', '.join(missing)}; give it in `at`")
    dual = np.concatenate([_packed(v, at[v]) for v in slots])
    if not np.isfinite(dual).all():
        raise InputError("numerical_conjugate: the duals must be finite")
    numbers = {s: np.asarray(v, dtype=float) for s, v in (values or {}).items()}
    problem = _Supremum(potential, slots, dual, numbers)
    found = problem.solve(tolerance)
    scale = max(problem.size_of_value(found), problem.size_at_rest())
    if not found.gap <= tolerance * scale and not (np.isinf(found.value) and found.gap == 0.0):
        raise ConvergenceError(
            f"numerical_conjugate: the gap {found.gap:.3g} exceeds {tolerance:g} of the size {scale:.3g} of the value; "
            "scale the duals, or give a larger tolerance"
        )
    return found


def _length(slot: Any) -> int:
    if not isinstance(slot, Ranked):
        return 1
    return 6 if slot.rank == 2 else 3


def _packed(slot: Any, value: Any) -> Any:
    import numpy as np

    found = np.atleast_1d(np.asarray(value, dtype=float))
    if found.shape != (_length(slot),):
        raise InputError(f"the dual of '{slot}' has shape {found.shape}; it must be ({_length(slot)},)")
    return found


def _plain(slot: Any, place: int) -> Any:
    name = f"slot_{place}"
    if not isinstance(slot, Ranked):
        return ScalarVariable(name)
    return TensorSymbol(name) if slot.rank == 2 else VectorSymbol(name)


@dataclass
class _Supremum:
    function: Extended
    slots: tuple[Any, ...]
    dual: Any
    numbers: dict[Any, Any]

    def __post_init__(self) -> None:
        # plain symbols in place of forces and rates, which hold their variable as an argument (∇T holds T, which is data)
        self.plain = {slot: _plain(slot, k) for k, slot in enumerate(self.slots)}
        self.function = self.function.map(lambda e: e.xreplace(self.plain))
        # surfaces f and −f, and ‖T‖ ≤ 0, are equalities: they hold up to rounding, and no point is moved off them
        surfaces = self.function.surfaces
        self.equalities, self.inequalities = [], []
        for k, f in enumerate(surfaces):
            twin = next((j for j, g in enumerate(surfaces) if j != k and (f + g).expand() == 0), None)
            if isinstance(f, NormLeaf) or (twin is not None and twin > k):
                self.equalities.append(f)
            elif twin is None:
                self.inequalities.append(f)
        self.places: dict[Any, int] = {}
        start = 0
        for slot in self.slots:
            self.places[self.plain[slot]] = start
            start += _length(slot)
        self.size = start

    def solve(self, tolerance: float) -> NumericalConjugate:
        import numpy as np

        try:
            best = self._conic(1.0, 1.0)
        except DeclarationError as reason:
            return self._smooth(reason)
        # again in the units of what was found, and in units beside them, until the gap is small enough
        for stretch, factor in ((1.0, 1.0), (1.0, 10.0), (10.0, 1.0), (0.1, 0.1)):
            if np.isinf(best.value) or not np.isfinite(best.gap):
                break
            length = max(
                float(np.abs(np.concatenate([np.atleast_1d(v) for v in best.argument.values()])).max()), AT_REST**6
            )
            unit = max(abs(best.value), float(np.abs(self.dual).max()) * length, 1e-300)
            if not (np.isfinite(length) and np.isfinite(unit)):
                break
            found = self._conic(stretch * length, factor * unit)
            # a ray in units that small is rounding: the value was found finite and bounded
            best = found if np.isfinite(found.value) and found.gap < best.gap else best
            if best.gap <= 0.1 * tolerance * self.size_of_value(best):
                break
        return best

    def size_of_value(self, found: NumericalConjugate) -> float:
        """Size of the terms whose difference the value is."""
        import numpy as np

        if not found.argument:
            return 1.0
        x = np.concatenate([np.atleast_1d(v) for v in found.argument.values()])
        return max(abs(found.value), float(np.abs(self.dual) @ np.abs(x)), 1e-300)

    def size_at_rest(self) -> float:
        """Size that stands for that of the value where the supremum is attained at zero, so that its terms have none."""
        import numpy as np

        return AT_REST * (float(np.abs(self.dual).max()) or 1.0)

    # -- conic -----------------------------------------------------------------------------------------------------------------

    def _conic(self, length: float, unit: float) -> NumericalConjugate:
        import cvxpy
        import numpy as np

        from ..conic_form import Frame, conic_expression

        z = cvxpy.Variable(self.size)
        frame = Frame(self.places, self.size, self.numbers, True)
        constraints: list[Any] = []
        finite = conic_expression(
            self._in_units(frame, self.function.finite, length) / Float(unit), frame, z, constraints
        )
        for e in self.equalities:
            if isinstance(e, NormLeaf):
                matrix, shift = frame.ranked(e.args[0])  # type: ignore[arg-type]
                constraints.append(matrix @ z + shift / length == 0.0)
            else:
                constraints.append(conic_expression(self._in_units(frame, e, length), frame, z, constraints) == 0.0)
        for f in self.inequalities:
            surface = conic_expression(self._in_units(frame, f, length) / Float(length), frame, z, constraints)
            constraints.append(surface <= 0.0)
        work = (length / unit) * self.dual
        problem = cvxpy.Problem(cvxpy.Minimize(finite - work @ z), constraints)
        if not problem.is_dcp():
            raise DeclarationError(f"the convexity of {self.function} does not follow from the rules of its atoms")
        if not constraints and (isinstance(finite, float) or finite.is_affine()):
            # y·x less an affine function is bounded only where it is constant
            ends = [
                finite if isinstance(finite, float) else self._at(finite, z, e)
                for e in np.vstack([0 * self.dual, np.eye(self.size)])
            ]
            slope = np.array(ends[1:]) - ends[0] - work
            if np.abs(slope).max() > 1e-12 * max(float(np.abs(work).max()), 1e-300):
                return NumericalConjugate(np.inf, {}, 0.0)
            return NumericalConjugate(-unit * float(ends[0]), self._unpacked(np.zeros(self.size)), 0.0)
        data, chain, _ = problem.get_problem_data(cvxpy.CLARABEL)
        options = {"tol_gap_abs": SOLVER, "tol_gap_rel": SOLVER, "tol_feas": SOLVER, "max_iter": 200}
        assert chain is not None
        raw = chain.solve_via_data(problem, data, solver_opts=options)
        status = str(raw.status)
        if "DualInfeasible" in status:
            return NumericalConjugate(np.inf, {}, 0.0)
        if "PrimalInfeasible" in status:
            raise InputError(f"{self.function} is nowhere finite at these values")
        v, dual = np.asarray(raw.x), np.asarray(raw.z)
        column = data["param_prob"].var_id_to_col[z.id]
        x = self._feasible(length * v[column : column + self.size])
        lower = self._objective(x)
        A, b, q = data["A"], np.asarray(data["b"]), np.asarray(data["c"])
        P = data.get("P")
        Pv = np.zeros_like(v)
        if P is not None:
            upper_triangle = P.toarray()
            full = np.triu(upper_triangle) + np.triu(upper_triangle, 1).T
            Pv = full @ v
        residual = Pv + q + A.T @ dual
        offset = float(data.get("offset", 0.0) or 0.0)
        offset += self._constant(problem, data, v, Pv, q)
        bound = -0.5 * float(v @ Pv) - float(b @ dual) + offset
        bound -= float(np.abs(residual).sum()) * REACH * float(np.abs(v).max(initial=1.0))
        return NumericalConjugate(
            lower, self._unpacked(x), max(-unit * bound - lower, 0.0) if np.isfinite(lower) else np.inf
        )

    def _in_units(self, frame: Any, expression: Any, length: float) -> Any:
        """The expression in u = x/length; a homogeneous invariant gives out its power of the length: every unknown is of order one."""
        unit = Float(length, 17)
        table: dict[Any, Any] = {s: unit * s for s in self.places if not isinstance(s, Ranked)}
        for leaf in expression.atoms(Invariant):
            if not frame.moves(leaf):
                continue
            degree = atom_of(leaf).degree(leaf)
            if degree is None:
                table[leaf] = leaf.xreplace({s: s * unit for s in self.places if isinstance(s, Ranked)})
                continue
            arguments = []
            for quantity in leaf.args:
                kept = [(a, c if frame.moves(a) else c / unit) for a, c in quantity.terms().items()]  # type: ignore[attr-defined]
                arguments.append(quantity.linear(kept))  # type: ignore[attr-defined]
            table[leaf] = unit**degree * leaf.func(*arguments)
        return frame.substituted(expression.xreplace(table))

    @staticmethod
    def _at(expression: Any, variable: Any, point: Any) -> float:
        variable.value = point
        return float(expression.value)

    def _constant(self, problem: Any, data: Any, v: Any, Pv: Any, q: Any) -> float:
        """Constant that the canonical form leaves out of the objective."""
        program = data["param_prob"]
        found = program.apply_parameters()
        # the last entry of (P, q, d, ...) that is a plain number is the offset
        offset = found[2] if len(found) == 5 else found[1]
        return float(offset) if not hasattr(offset, "shape") or offset.shape == () else 0.0

    def _feasible(self, x: Any) -> Any:
        """x, moved towards zero until every surface is met (where zero is in the set; equalities keep x as it is)."""
        if not self._violated(x) or self.equalities:
            return x
        lo, hi = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (lo + hi)
            lo, hi = (lo, middle) if self._violated(middle * x) else (middle, hi)
        return lo * x

    def _violated(self, x: Any) -> bool:
        table = self._table(x)
        return any(not float(evaluate(f, table)) <= 0.0 for f in self.inequalities)

    def _table(self, x: Any) -> dict[Any, Any]:
        return {**self.numbers, **{self.plain[slot]: value for slot, value in self._unpacked(x).items()}}

    def _unpacked(self, x: Any) -> dict[Any, Any]:
        found = {}
        for slot in self.slots:
            start = self.places[self.plain[slot]]
            part = x[start : start + _length(slot)]
            found[slot] = part if isinstance(slot, Ranked) else part[0]
        return found

    def _objective(self, x: Any) -> float:
        return float(self.dual @ x - evaluate(self.function.finite, self._table(x)))

    # -- without conic form ------------------------------------------------------------------------------------------------------

    def _smooth(self, reason: DeclarationError) -> NumericalConjugate:
        """Minimisation by gradients: a lower bound only, the gap is infinite."""
        import numpy as np
        from scipy.optimize import minimize

        if self.function.surfaces:
            raise DeclarationError(f"no certified conjugate: {reason}") from None
        slopes = {slot: partial(self.function.finite, self.plain[slot]) for slot in self.slots}

        def slope(x: Any) -> Any:
            table = self._table(x)
            parts = [np.atleast_1d(evaluate(slopes[s], table)) for s in self.slots]
            return np.concatenate(parts) - self.dual

        found = minimize(lambda x: -self._objective(x), np.zeros(self.size), jac=slope, method="BFGS", tol=1e-12)
        return NumericalConjugate(self._objective(found.x), self._unpacked(found.x), np.inf)


def _points(conjugate: Conjugate, table: Mapping[Any, Any]) -> tuple[int | None, list[dict[Any, Any]]]:
    """Number of points (None for one without an axis) and the values of each."""
    import numpy as np

    arrays = {s: np.asarray(v, dtype=float) for s, v in table.items()}
    count = None
    for symbol, value in arrays.items():
        rank = int(isinstance(symbol, Ranked))
        if value.ndim > rank:
            count = max(count or 0, value.shape[0])
    rows = []
    for k in range(1 if count is None else count):
        row = {}
        for symbol, value in arrays.items():
            rank = int(isinstance(symbol, Ranked))
            row[symbol] = value[k if value.shape[0] > 1 else 0] if value.ndim > rank else value
        rows.append(row)
    return count, rows


def _solved(conjugate: Conjugate, table: Mapping[Any, Any]) -> tuple[int | None, list[NumericalConjugate]]:
    count, rows = _points(conjugate, table)
    found = []
    for row in rows:
        at = {slot: row[dual] for slot, dual in conjugate.duals.items()}
        data = {s: v for s, v in row.items() if s not in conjugate.duals.values()}
        found.append(numerical_conjugate(conjugate.function, conjugate.slots, at, data))
    return count, found


def conjugate_values(conjugate: Conjugate, table: Mapping[Any, Any]) -> Any:
    """F* at the points of `table`, each certified."""
    import numpy as np

    count, found = _solved(conjugate, table)
    values = np.array([f.value for f in found])
    return values[0] if count is None else values


def conjugate_arguments(conjugate: Conjugate, table: Mapping[Any, Any]) -> dict[Any, Any]:
    """Arguments of the suprema at the points of `table`."""
    import numpy as np

    count, found = _solved(conjugate, table)
    stacked = {s: np.array([f.argument[s] for f in found]) for s in conjugate.slots}
    return {s: v[0] if count is None else v for s, v in stacked.items()}
