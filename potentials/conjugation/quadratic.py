"""Conjugate of an isotropic quadratic form in several tensors, vectors and scalars, degenerate or not.

A form is kept in coordinates: traces and scalars, deviators, vectors; in each of the three it is one symmetric matrix of scalars over the
slots and the data (frozen tensors, internal variables that are not exchanged, the constant 1). With I a largest set of independent
slots, J the other slots and D the data,

    (½ xᵀMx)*(y) = ½ y_Iᵀ G y_I − y_Iᵀ G M_ID x_D + ½ x_Dᵀ (M_DI G M_ID − M_DD) x_D,   G = M_II⁻¹,
    finite where y_J − M_JD x_D = M_JI G (y_I − M_ID x_D).

Reference: Rockafellar 1970, §12.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from sympy import (
    Add,
    Dummy,
    Expr,
    Function,
    Matrix,
    Poly,
    PolynomialError,
    Pow,
    Rational,
    S,
    cancel,
    default_sort_key,
    factor,
    together,
)

from ..atoms.atom import Invariant
from ..atoms.eig_max import EigMaxLeaf
from ..atoms.eig_min import EigMinLeaf
from ..atoms.inner import InnerLeaf, inner
from ..atoms.trace import TraceLeaf, tr
from ..ranked import Ranked
from ..scalars import ScalarVariable, Temperature
from ..tensor import Deviator, IdentityTensor, dev, from_terms
from .slots import Functional

__all__ = ["Node", "Quadratic", "QuadraticConjugate", "gathered", "nodes_of", "tidy_scalar"]

Node = tuple[str, Any]
"""("tr", X) and ("dev", X) of a tensor, ("vec", v), ("num", p); ("one", None) is the constant."""
ONE: Node = ("one", None)
THIRD = Rational(1, 3)
BLOCKS = (("tr", "num", "one"), ("dev",), ("vec",))


def nodes_of(slot: Any) -> tuple[Node, ...]:
    """Coordinates of a slot."""
    if isinstance(slot, Ranked):
        return (("tr", slot), ("dev", slot)) if slot.rank == 2 else (("vec", slot),)
    return (("num", slot),)


def tidy_scalar(expression: Expr) -> Expr:
    """One fraction, factored; for coefficients in parameters."""
    if expression.is_number or expression.is_Symbol:
        return expression
    try:
        return factor(cancel(together(expression)))
    except (PolynomialError, NotImplementedError, AttributeError):
        return expression


def gathered(expression: Expr) -> Expr:
    """A polynomial in invariants and variables with factored coefficients; terms that are no polynomial stay as they stand."""
    plain, warm, odd = [], [], []
    for term in Add.make_args(expression):
        if _is_odd(term):
            odd.append(term)
        else:
            data = term.has(Temperature) and not term.atoms(Invariant) and not _variables(term)
            (warm if data else plain).append(term)
    return _polynomial(Add(*plain)) + tidy_scalar(Add(*warm)) + Add(*odd)


def _is_odd(term: Expr) -> bool:
    """True if a function, or a power that is no polynomial, of a variable or of the temperature stands in the term."""
    for node in term.atoms(Function, Pow):
        if isinstance(node, Pow) and node.exp.is_Integer and node.exp > 0:
            continue
        if node.atoms(Invariant) or _variables(node) or (isinstance(node, Function) and node.has(Temperature)):
            return True
    return False


def _variables(expression: Expr) -> list[Any]:
    """Scalar variables; multipliers and the temperature count as parameters."""
    return [s for s in expression.atoms(ScalarVariable) if not _is_coefficient(s)]


def _is_coefficient(symbol: Any) -> bool:
    return symbol.role == "multiplier" or isinstance(symbol, Temperature)


def _polynomial(expression: Expr) -> Expr:
    generators = sorted((*expression.atoms(Invariant), *_variables(expression)), key=default_sort_key)
    if not generators:
        return tidy_scalar(expression)
    dummies = [Dummy() for _ in generators]
    body = expression.xreplace(dict(zip(generators, dummies, strict=True)))
    try:
        terms = Poly(body, *dummies).terms()
    except PolynomialError:
        return expression
    total: Any = S.Zero
    for powers, coefficient in terms:
        product = tidy_scalar(coefficient)
        for generator, power in zip(generators, powers, strict=True):
            product = product * generator**power
        total = total + product
    return total


def _pair(a: Node, b: Node) -> tuple[Node, Node]:
    return (a, b) if (a[0], str(a[1])) <= (b[0], str(b[1])) else (b, a)


@dataclass
class QuadraticConjugate:
    """Conjugate = `half` + `linear` + `constant` where the equalities hold; `half` is the part of degree two in the duals."""

    half: Expr
    linear: Expr
    constant: Expr
    equalities: list[Any]
    conditions: list[Expr]

    @property
    def value(self) -> Expr:
        return gathered(self.half + self.linear + self.constant)


@dataclass
class Quadratic:
    """Σ C_ij x_i·x_j over nodes of slots and data."""

    slots: tuple[Any, ...]
    table: dict[tuple[Node, Node], Expr] = field(default_factory=dict)

    # -- building --------------------------------------------------------------------------------------------------------------

    def _add(self, a: Node, b: Node, weight: Expr) -> None:
        key = _pair(a, b)
        self.table[key] = self.table.get(key, S.Zero) + weight

    def _lists(self, quantity: Any) -> dict[str, list[tuple[Node, Expr]]]:
        """Coordinates of a tensor or vector: its trace and its deviator, or itself, as sums over nodes."""
        if quantity.rank == 1:
            return {"vec": [(("vec", a), c) for a, c in quantity.terms().items()]}
        trace: list[tuple[Node, Expr]] = []
        deviator: dict[Node, Expr] = {}
        for atom, c in quantity.terms().items():
            if isinstance(atom, IdentityTensor):
                trace.append((ONE, 3 * c))
                continue
            base = atom.args[0] if isinstance(atom, Deviator) else atom
            deviator[("dev", base)] = deviator.get(("dev", base), S.Zero) + c
            if not isinstance(atom, Deviator):
                trace.append((("tr", base), c) if base in self.slots else (ONE, c * tr(base)))
        return {"tr": trace, "dev": list(deviator.items())}

    def add_inner(self, weight: Expr, first: Ranked, second: Ranked) -> None:
        """weight · first:second."""
        a, b = self._lists(first), self._lists(second)
        for kind, scale in (("tr", weight * THIRD), ("dev", weight), ("vec", weight)):
            for x, c in a.get(kind, ()):
                for y, d in b.get(kind, ()):
                    self._add(x, y, scale * c * d)

    def _scalars(self, functional: Functional) -> list[tuple[Node, Expr]]:
        found: list[tuple[Node, Expr]] = [(ONE, functional.constant)] if functional.constant != 0 else []
        for slot, a in functional.parts.items():
            found.append(
                (("tr", slot), next(iter(a.terms().values()))) if isinstance(a, Ranked) else (("num", slot), a)
            )
        return found

    def add_product(self, weight: Expr, first: Functional, second: Functional) -> None:
        """weight · first · second of isotropic functionals."""
        for x, c in self._scalars(first):
            for y, d in self._scalars(second):
                self._add(x, y, weight * c * d)

    def add_linear(self, weight: Expr, functional: Functional) -> None:
        """weight · functional, of any kind."""
        self.add_constant(weight * functional.constant)
        for slot, a in functional.parts.items():
            if not isinstance(a, Ranked):
                self._add(("num", slot), ONE, weight * a)
            elif slot.rank == 1:
                for atom, c in a.terms().items():
                    self._add(("vec", slot), ("vec", atom), weight * c)
            else:
                self._add(("tr", slot), ONE, weight * THIRD * tr(a))  # type: ignore[arg-type]
                for node, c in self._lists(a)["dev"]:
                    self._add(("dev", slot), node, weight * c)

    def add_constant(self, value: Expr) -> None:
        """A term in data alone."""
        self._add(ONE, ONE, value)

    def tidied(self) -> Quadratic:
        """The same without terms that cancel."""
        found = {key: tidy_scalar(c) for key, c in self.table.items()}
        return Quadratic(self.slots, {key: c for key, c in found.items() if c != 0})

    # -- asking ----------------------------------------------------------------------------------------------------------------

    def is_slot(self, node: Node) -> bool:
        return node[1] in self.slots and node[0] != "one"

    def entry(self, a: Node, b: Node) -> Expr:
        """M_ij."""
        c = self.table.get(_pair(a, b), S.Zero)
        return 2 * c if a == b else c

    def nodes(self) -> list[Node]:
        found = {n for pair in self.table for n in pair}
        return sorted(found, key=lambda n: (n[0] == "one", self._place(n[1]), n[0] == "tr", str(n[1])))

    def _place(self, symbol: Any) -> int:
        return self.slots.index(symbol) if symbol in self.slots else len(self.slots)

    def curved(self) -> list[Node]:
        """Slot nodes in which the form is not only linear."""
        return list(dict.fromkeys(n for p in self.table for n in p if self.is_slot(p[0]) and self.is_slot(p[1])))

    def couplings(self) -> list[tuple[Node, Node]]:
        """Pairs of different slot nodes that the form couples."""
        return [(a, b) for a, b in self.table if a != b and self.is_slot(a) and self.is_slot(b)]

    def restricted(self, keep: Callable[[Node], bool]) -> Quadratic:
        """Terms in which a kept slot node stands."""
        return Quadratic(
            self.slots,
            {p: c for p, c in self.table.items() if any(self.is_slot(n) and keep(n) for n in p)},
        )

    def without(self, other: Quadratic) -> Quadratic:
        return Quadratic(self.slots, {p: c for p, c in self.table.items() if p not in other.table})

    def slope_of_data(self, slot: Any) -> Any:
        """Coefficient b of the linear term b·x of a slot, as a quantity of its rank."""
        if not isinstance(slot, Ranked):
            return self.entry(("num", slot), ONE)
        if slot.rank == 1:
            terms = {b[1]: self.entry(a, b) for a, b in self._data_pairs(("vec", slot))}
            return slot.linear(terms.items())
        from ..tensor import identity

        total: Any = identity * self.entry(("tr", slot), ONE)
        for a, b in self._data_pairs(("dev", slot)):
            total = total + dev(b[1]) * self.entry(a, b)
        return total

    def _data_pairs(self, node: Node) -> list[tuple[Node, Node]]:
        found = []
        for a, b in self.table:
            if a == node and not self.is_slot(b):
                found.append((a, b))
            elif b == node and not self.is_slot(a):
                found.append((b, a))
        return found

    # -- conjugate -------------------------------------------------------------------------------------------------------------

    def conjugate(self, duals: dict[Any, Any]) -> QuadraticConjugate:
        """Conjugate over the slot nodes that stand in the form, at duals of the slots."""
        found = QuadraticConjugate(S.Zero, S.Zero, S.Zero, [], [])
        pairs: dict[str, dict[tuple[Any, Any], Expr]] = {"half": {}, "linear": {}, "constant": {}}
        scalars = {"half": S.Zero, "linear": S.Zero, "constant": S.Zero}
        everywhere = self.nodes()
        for kinds in BLOCKS:
            members = [n for n in everywhere if n[0] in kinds]
            if members:
                self._block(members, duals, found, pairs, scalars)
        whole = {n[1] for n in everywhere if n[0] == "tr"} | {n[1] for n in everywhere if not self.is_slot(n)}
        for part in pairs:
            setattr(found, part, _assembled(pairs[part], scalars[part], duals, whole))
        return found

    def _block(self, members: list[Node], duals: dict[Any, Any], found: Any, pairs: Any, scalars: Any) -> None:
        slots = [n for n in members if self.is_slot(n)]
        data = [n for n in members if not self.is_slot(n)]
        chosen: list[Node] = []
        for node in slots:
            trial = [*chosen, node]
            minor = tidy_scalar(Matrix([[self.entry(a, b) for b in trial] for a in trial]).det())
            if minor != 0:
                chosen.append(node)
                found.conditions.append(minor)
        G = Matrix(len(chosen), len(chosen), lambda i, j: self.entry(chosen[i], chosen[j]))
        G = G.inv().applyfunc(tidy_scalar) if chosen else G
        MD = Matrix(len(chosen), len(data), lambda i, j: self.entry(chosen[i], data[j]))
        rest = Matrix(len(data), len(data), lambda i, j: self.entry(data[i], data[j]))
        slope = (G * MD).applyfunc(tidy_scalar) if chosen and data else Matrix(len(chosen), len(data), lambda i, j: 0)
        both = MD.T * slope - rest if chosen and data else -rest

        def put(part: str, a: Node, b: Node, weight: Any) -> None:
            weight = tidy_scalar(weight)
            if weight == 0:
                return
            x, y = self._dual(a, duals), self._dual(b, duals)
            if isinstance(x, Ranked):
                key = (a, b)
                pairs[part][key] = pairs[part].get(key, S.Zero) + weight
            else:
                scalars[part] = scalars[part] + weight * x * y

        for i, a in enumerate(chosen):
            for j, b in enumerate(chosen):
                if j >= i:
                    put("half", a, b, G[i, j] / (2 if i == j else 1))
            for j, b in enumerate(data):
                put("linear", a, b, -slope[i, j])
        for i, a in enumerate(data):
            for j, b in enumerate(data):
                if j >= i:
                    put("constant", a, b, both[i, j] / (2 if i == j else 1))
        for node in slots:
            if node in chosen:
                continue
            row = Matrix(1, len(chosen), lambda _, j: self.entry(node, chosen[j]))  # noqa: B023
            weights = row * G if chosen else row
            residual: Any = self._dual(node, duals)
            for b in data:
                residual = residual - self._dual(b, duals) * self.entry(node, b)
            for i, a in enumerate(chosen):
                part: Any = self._dual(a, duals)
                for j, b in enumerate(data):
                    part = part - self._dual(b, duals) * MD[i, j]
                residual = residual - part * tidy_scalar(weights[i])
            found.equalities.append(residual)

    def _dual(self, node: Node, duals: dict[Any, Any]) -> Any:
        """η = tr(Y)/3, dev Y, y of a slot node; the data itself of a data node."""
        kind, symbol = node
        if kind == "one":
            return S.One
        if not self.is_slot(node):
            return dev(symbol) if kind == "dev" else symbol
        dual = duals[symbol]
        if kind == "tr":
            return tr(dual) * THIRD if dual.terms() else S.Zero
        return dev(dual) if kind == "dev" else dual


def _assembled(pairs: dict[Any, Expr], scalar: Any, duals: dict[Any, Any], whole: set[Any]) -> Expr:
    """Σ w dev a:dev b + scalar, or with whole tensors Σ w a:b + (scalar − Σ w tr a tr b/3), whichever is shorter."""
    plain: Any = scalar
    joined: Any = scalar
    possible = False
    for (a, b), w in pairs.items():
        x, y = duals.get(a[1], a[1]), duals.get(b[1], b[1])
        if a[0] == "vec":
            plain, joined = plain + w * inner(x, y), joined + w * inner(x, y)
            continue
        plain = plain + w * inner(dev(x), dev(y))
        if a[1] in whole and b[1] in whole:
            possible = True
            joined = joined + w * (inner(x, y) - tr(x) * tr(y) * THIRD)
        else:
            joined = joined + w * inner(dev(x), dev(y))
    plain = gathered(opened(plain))
    if not possible:
        return plain
    joined = gathered(opened(joined))
    return joined if joined.count_ops() <= plain.count_ops() else plain


def opened(expression: Expr) -> Expr:
    """The expression with traces of sums, products with I and eigenvalues of T + c I written out."""
    table: dict[Any, Any] = {}
    for leaf in expression.atoms(EigMaxLeaf, EigMinLeaf):
        terms = leaf.args[0].terms()  # type: ignore[attr-defined]
        spherical = next((c for t, c in terms.items() if isinstance(t, IdentityTensor)), S.Zero)
        if spherical != 0 and len(terms) > 1:
            table[leaf] = spherical + leaf.func(
                from_terms({t: c for t, c in terms.items() if not isinstance(t, IdentityTensor)})
            )
    for leaf in expression.atoms(TraceLeaf, InnerLeaf):
        if isinstance(leaf, TraceLeaf):
            atoms = leaf.args[0].terms()  # type: ignore[attr-defined]
            if len(atoms) > 1 or next(iter(atoms.values())) != 1:
                table[leaf] = sum((c * tr(a) for a, c in atoms.items()), S.Zero)
        else:
            a, b = leaf.args
            if any(isinstance(t, IdentityTensor) for t in (*a.terms(), *b.terms())):  # type: ignore[attr-defined]
                table[leaf] = _inner_with_identity(a, b)
    if not table:
        return expression
    return Add(*(t.xreplace(table).expand() if t.has(*table) else t for t in Add.make_args(expression)))


def _inner_with_identity(a: Any, b: Any) -> Expr:
    def split(t: Any) -> tuple[Expr, Any]:
        terms = t.terms()
        return (
            sum((c for x, c in terms.items() if isinstance(x, IdentityTensor)), S.Zero),
            from_terms({x: c for x, c in terms.items() if not isinstance(x, IdentityTensor)}),
        )

    (c, x), (d, y) = split(a), split(b)
    total = 3 * c * d
    total = total + (c * tr(y) if y.terms() else 0) + (d * tr(x) if x.terms() else 0)
    return total + (inner(x, y) if x.terms() and y.terms() else S.Zero)
