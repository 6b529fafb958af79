"""The functions that have a conjugate of their own: quadratic forms, gauges √Q, functions of one scalar, functions of eigenvalues.

Each knows the coordinates (nodes) it depends on, and its conjugate at duals of the slots.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sympy import Expr, S, Symbol, sqrt

from ..atoms.eig_max import EigMaxLeaf, eig_max
from ..atoms.eig_min import EigMinLeaf, eig_min
from ..atoms.eig_sum import eig_sum
from ..atoms.inner import inner
from ..atoms.maximum import Maximum
from ..atoms.norm import norm
from ..atoms.positive_part import PositivePart
from ..atoms.positive_square import PositiveSquareLeaf
from ..atoms.positive_trace import PositiveTraceLeaf
from ..atoms.trace import TraceLeaf, tr
from ..ranked import Ranked
from ..tensor import PositiveTensor
from .form import MinForm, NoRule
from .one_variable import conjugate_of_one_variable, positive_view
from .quadratic import Node, Quadratic, nodes_of, opened, tidy_scalar
from .slots import Functional, Parts

__all__ = [
    "EigenGroup",
    "GaugeGroup",
    "QuadraticGroup",
    "ScalarGroup",
    "UnilateralGroup",
    "conjugate_of_eigenvalues",
    "length_of",
    "root_of",
]

E = Symbol("x", real=True)


@dataclass
class QuadraticGroup:
    """A convex quadratic form."""

    form: Quadratic

    @property
    def nodes(self) -> set[Node]:
        return {n for n in self.form.nodes() if self.form.is_slot(n)}

    def conjugate(self, duals: dict[Any, Any]) -> MinForm:
        found = self.form.conjugate(duals)
        return MinForm(
            found.value,
            equalities=tuple(found.equalities),
            conditions=tuple(found.conditions),
            rules=("conjugate of a quadratic form",),
        )


def length_of(square: Expr) -> Expr:
    """√(w T:T) as √w ‖T‖."""
    from ..atoms.inner import InnerLeaf

    leaves = list(square.atoms(InnerLeaf))
    if len(leaves) == 1 and leaves[0].args[0] == leaves[0].args[1]:
        weight = square / leaves[0]
        if not weight.has(InnerLeaf, TraceLeaf):
            return root_of(weight) * norm(leaves[0].args[0])  # type: ignore[arg-type]
    return root_of(square)


def root_of(value: Expr) -> Expr:
    """√ of a non-negative expression, with parameters that are bounded by zero from below taken as positive: √(r²) is r."""
    table = positive_view(value)
    return sqrt(value.xreplace(table)).xreplace({d: p for p, d in table.items()})


@dataclass
class GaugeGroup:
    """c √Q with a quadratic form Q ≥ 0: the support function of an ellipsoid; with Q = r² + d², c √Q has the conjugate −d √(c² − r°²)."""

    weight: Expr
    form: Quadratic

    @property
    def nodes(self) -> set[Node]:
        return {n for n in self.form.nodes() if self.form.is_slot(n)}

    def half(self) -> Quadratic:
        return Quadratic(self.form.slots, {k: c / 2 for k, c in self.form.table.items()})

    def conjugate(self, duals: dict[Any, Any]) -> MinForm:
        found = self.half().conjugate(duals)
        polar = length_of(opened(2 * found.half))
        # the constant part of the conjugate of Q/2 is −d²/2
        rest = tidy_scalar(-2 * found.constant)
        equalities = tuple(found.equalities)
        if rest == 0:
            return MinForm(
                found.linear,
                (polar - self.weight,),
                equalities,
                rules=("norm ↔ indicator of the unit ball of the dual norm",),
            )
        inside = self.weight**2 - opened(2 * found.half)
        return MinForm(
            found.linear - root_of(rest) * sqrt(inside),
            (polar - self.weight,),
            equalities,
            conditions=(rest,),
            rules=("conjugate of √(r² + d²) is −d √(1 − r°²) on r° ≤ 1",),
        )


@dataclass
class ScalarGroup:
    """H(ℓ(x)) of one linear functional ℓ, H an expression in the symbol x."""

    slots: tuple[Any, ...]
    direction: Functional
    function: Expr

    @property
    def nodes(self) -> set[Node]:
        found: set[Node] = set()
        for slot, a in self.direction.parts.items():
            if not isinstance(a, Ranked):
                found.add(("num", slot))
            elif slot.rank == 1:
                found.add(("vec", slot))
            else:
                found |= {("tr", slot)} if tr(a) != 0 else set()
                found |= {("dev", slot)} if not self.direction.is_isotropic() else set()
        return found

    def conjugate(self, duals: dict[Any, Any]) -> MinForm:
        if not self.direction.is_isotropic():
            raise NoRule(f"no conjugate is known for a function of {self.direction.parts}")
        first, *others = [(s, a) for s in self.slots if (a := self.direction.parts.get(s)) is not None]
        zeta = tidy_scalar_dual(*first, duals)
        found = conjugate_of_one_variable(self.function, E, zeta)
        if found is None:
            raise NoRule(f"no conjugate is known for {self.function} as a function of {E}")
        equalities = tuple(tidy_scalar_dual(s, a, duals) - zeta for s, a in others)
        return MinForm(
            found.value,
            found.domain,
            equalities,
            conditions=tuple(found.conditions),
            rules=(found.rule,),
        )


def tidy_scalar_dual(slot: Any, a: Any, duals: dict[Any, Any]) -> Expr:
    """ζ with y = ζ a: of a tensor slot with a = c I, tr(Y)/(3c)."""
    dual = duals[slot]
    if isinstance(a, Ranked):
        (c,) = a.terms().values()
        return opened(tr(dual) / (3 * c)) if dual.terms() else S.Zero  # type: ignore[arg-type]
    return dual / a


@dataclass
class EigenGroup:
    """Functions of the eigenvalues of one tensor T = Σ c X + shift: Σ G(t_i) + top t_max − low t_min."""

    slots: tuple[Any, ...]
    parts: Parts
    function: Expr = S.Zero
    top: Expr = S.Zero
    low: Expr = S.Zero

    @property
    def nodes(self) -> set[Node]:
        return {n for slot in self.parts.linear for n in nodes_of(slot)}

    def add(self, leaf: Any, weight: Expr) -> None:
        """One more term in the same tensor."""
        if isinstance(leaf, PositiveSquareLeaf):
            self.function = self.function + weight * PositivePart(E) ** 2
        elif isinstance(leaf, PositiveTraceLeaf):
            self.function = self.function + weight * PositivePart(E)
        elif isinstance(leaf, EigMaxLeaf):
            self.top = self.top + weight
        elif isinstance(leaf, EigMinLeaf):
            self.low = self.low - weight
        else:
            function = leaf.args[0]
            self.function = self.function + weight * function.expr.xreplace({function.variables[0]: E})

    def dual(self, duals: dict[Any, Any]) -> tuple[Any, list[Any]]:
        """Dual Z of T, and the equalities that make it one."""
        order = sorted(self.parts.linear, key=lambda s: (not self.parts.linear[s][0].is_number, self.slots.index(s)))
        first, *others = order
        Z = duals[first] / self.parts.linear[first][0]
        return Z, [duals[s] - Z * self.parts.linear[s][0] for s in others]

    def shifted(self, Z: Any) -> Expr:
        return -inner(self.parts.rest, Z) if self.parts.rest.terms() else S.Zero

    def conjugate(self, duals: dict[Any, Any]) -> MinForm:
        Z, equalities = self.dual(duals)
        shift = opened(self.shifted(Z))
        # the terms of a group are either extreme eigenvalues or functions of all of them
        found = self._extreme(Z) if self.function == 0 else conjugate_of_eigenvalues(self.function, E, Z)
        return MinForm(
            found.value + shift,
            found.inequalities,
            (*found.equalities, *equalities),
            conditions=found.conditions,
            rules=found.rules,
        )

    def _extreme(self, Z: Any) -> MinForm:
        # (a t_max − b t_min)* = I{tr Z = a − b, tr Z⁺ ≤ a}: Z = Y₁ − Y₂ with Y ⪰ 0, tr Y₁ = a, tr Y₂ = b
        equal = opened(tr(Z)) - (self.top - self.low)
        rule = "extreme eigenvalues ↔ indicator of their polar set"
        if self.low == 0:
            return MinForm(S.Zero, (-eig_min(Z),), (equal,), rules=(rule,))
        if self.top == 0:
            return MinForm(S.Zero, (eig_max(Z),), (equal,), rules=(rule,))
        return MinForm(S.Zero, (tr(PositiveTensor(Z)) - self.top,), (equal,), rules=(rule,))


def conjugate_of_eigenvalues(function: Expr, symbol: Any, Z: Any) -> MinForm:
    """(Σ g(t_i))* = Σ g*(z_i) for an expression g of a symbol; its domain by the extreme eigenvalues of Z (Lewis 1996)."""
    one = Symbol("x", real=True)
    found = conjugate_of_one_variable(function, symbol, one)
    if found is None:
        raise NoRule(f"no conjugate is known for {function} of an eigenvalue")
    value, bounds = found.value, []
    for f in found.domain:
        slope = f.diff(one)
        if slope.has(one) or slope == 0:
            raise NoRule(f"the domain {f} <= 0 of an eigenvalue has no closed form")
        down = slope.could_extract_minus_sign()
        bounds.append((-eig_min(Z) if down else eig_max(Z)) + f.xreplace({one: S.Zero}) / (-slope if down else slope))
    # inside the domain a positive part of the dual is the dual itself
    if -one in found.domain:
        value = value.xreplace({PositivePart(one): one})
    if one in found.domain:
        value = value.xreplace({PositivePart(-one): -one})
    square = tidy_scalar(value / one**2)
    if not square.has(one):
        total: Expr = square * inner(Z, Z)
    else:
        total = eig_sum(lambda x: value.xreplace({one: x}), Z) if value.has(one) else 3 * value
    return MinForm(
        total,
        tuple(bounds),
        conditions=tuple(found.conditions),
        rules=("conjugate of a spectral function: conjugate of the function of an eigenvalue", found.rule),
    )


@dataclass
class UnilateralGroup:
    """λ/2 ⟨tr T⟩² + μ T^≥:T^≥, the infimal convolution of the conjugates of its two terms in closed form."""

    eigen: EigenGroup
    lam: Expr
    mu: Expr

    @property
    def nodes(self) -> set[Node]:
        return self.eigen.nodes

    def conjugate(self, duals: dict[Any, Any]) -> MinForm:
        Z, equalities = self.eigen.dual(duals)
        lam, mu = self.lam, self.mu
        trace, square = opened(tr(Z)), inner(Z, Z)
        y = -Maximum(-eig_min(Z), -lam * trace / (2 * mu + 3 * lam))
        value = y**2 / (2 * lam) + (square - 2 * y * trace + 3 * y**2) / (4 * mu)
        shift = opened(self.eigen.shifted(Z))
        return MinForm(
            value + shift,
            (-eig_min(Z),),
            tuple(equalities),
            conditions=(mu, lam),
            rules=("conjugate of the unilateral energy, three cases",),
            cases=_cases(Z, lam, mu, shift),
        )


def _cases(Z: Any, lam: Expr, mu: Expr, shift: Expr) -> tuple[tuple[str, str], ...]:
    from sympy import latex, sstr

    z, l, m = sstr(Z), sstr(lam), sstr(mu)
    zt, lt, mt = latex(Z), latex(lam), latex(mu)
    least, least_tex = f"smallest eigenvalue of {z}", rf"\lambda_{{\min}}\left({zt}\right)"
    limit, limit_tex = f"{l}*tr({z})/(2*{m} + 3*{l})", rf"\frac{{{lt}\,\mathrm{{tr}}\,{zt}}}{{2 {mt} + 3 {lt}}}"
    hooke = f"inner({z}, {z})/(4*{m}) - {l}*tr({z})**2/(4*{m}*(2*{m} + 3*{l}))"
    hooke_tex = (
        rf"\frac{{{zt}:{zt}}}{{4 {mt}}} - \frac{{{lt} \left(\mathrm{{tr}}\,{zt}\right)^2}}{{4 {mt} (2 {mt} + 3 {lt})}}"
    )
    found = (
        (
            f"{hooke} if the {least} >= {limit} (all strains >= 0)",
            rf"{hooke_tex} \quad\text{{if }} {least_tex} \geq {limit_tex}",
        ),
        (
            f"y**2/(2*{l}) + inner({z} - y*I, {z} - y*I)/(4*{m}) with y = {least}, if 0 < y < {limit}",
            rf"\frac{{y^2}}{{2 {lt}}} + \frac{{\left\|{zt} - y \boldsymbol{{I}}\right\|^2}}{{4 {mt}}} \quad\text{{if }} "
            rf"0 < y = {least_tex} < {limit_tex}",
        ),
        (
            f"inner({z}, {z})/(4*{m}) if the {least} is 0, and for {l} = 0 wherever it is >= 0; the strain is then not unique",
            rf"\frac{{{zt}:{zt}}}{{4 {mt}}} \quad\text{{if }} {least_tex} = 0, \text{{ and for }} {lt} = 0 "
            rf"\text{{ wherever }} {least_tex} \geq 0",
        ),
    )
    if shift == 0:
        return found
    return tuple((f"{sstr(shift)} + {a}", f"{latex(shift)} + {b}") for a, b in found)
