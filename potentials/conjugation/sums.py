"""Conjugate of a sum of functions: separable parts apart, functions of the same coordinates by infimal convolution.

    (Σ g_k∘L_k)*(y) = min { Σ g_k*(z_k) : Σ L_kᵀ z_k = y }

Coordinates are traces, deviators, vectors and scalars of the slots; functions without a common coordinate have nothing to share. What the
equalities determine is eliminated; a coordinate that nothing depends on has the dual zero.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from sympy import Add, Expr, S, Symbol

from ..atoms.maximum import Maximum
from ..atoms.positive_part import PositivePart
from ..atoms.trace import tr
from ..extended import Extended
from ..ranked import Ranked
from ..scalars import Parameter, ScalarVariable
from ..tensor import TensorSymbol, dev, identity
from ..vector import VectorSymbol
from .elimination import eliminated
from .form import MinForm, Phase, is_zero
from .groups import E, EigenGroup, GaugeGroup, QuadraticGroup, ScalarGroup, UnilateralGroup
from .one_variable import conjugate_of_one_variable
from .quadratic import Node, Quadratic, nodes_of, tidy_scalar
from .slots import Multiplier, functional_of
from .sorting import Sorter

__all__ = ["conjugate_form"]


def conjugate_form(function: Extended, slots: Iterable[Any], duals: dict[Any, Any]) -> MinForm:
    """F* over `slots` at the given duals; `NoRule` names the term that has no rule. Surfaces f and −f are the equality f = 0."""
    order = list(slots)
    sorter = Sorter(tuple(order))
    waiting = list(function.surfaces)
    while waiting:
        surface = waiting.pop(0)
        opposite = next((g for g in waiting if (surface + g).expand() == 0), None)
        if opposite is not None and functional_of(surface, order) is not None:
            waiting.remove(opposite)
            sorter.add_equation(surface)
        else:
            sorter.add_surface(surface)
    sorter.add(function.finite)
    form = _Sum(sorter, duals).conjugate()
    return eliminated(form, duals)


class _Sum:
    def __init__(self, sorter: Sorter, duals: dict[Any, Any]) -> None:
        self.slots = sorter.slots
        self.duals = dict(duals)
        self.named = dict(duals)
        self.form = sorter.extra
        self.data = sorter.data
        self.quadratic = sorter.quadratic.tidied()
        self.leftover = Quadratic(self.slots)
        self._taken: set[Any] = set()
        self.groups: list[Any] = [*sorter.gauges, *sorter.scalars, *sorter.eigen]
        self.groups = self._unilateral(self.groups)
        self._merge_scalars()
        self.groups = [part for g in self.groups for part in self._parted(g)]

    def conjugate(self) -> MinForm:
        self._tilt()
        components = self._components()
        touched: set[Node] = set()
        for nodes, quadratic, groups in components:
            touched |= nodes
            part = self._component(quadratic, groups)  # may add a multiplier to the form
            self.form = self.form + part
        self.form = replace(self.form, value=self.form.value + self._constant() - self.data)
        if len(components) > 1:
            self.form = self.form.with_rule("sum of functions of different coordinates")
        for slot in self.slots:
            self._untouched(slot, touched)
        return self.form

    # -- tilting and data ------------------------------------------------------------------------------------------------------

    def _tilt(self) -> None:
        """A linear term b·x where the quadratic form is flat: F* is taken at y − b."""
        curved = set(self.quadratic.curved())
        for slot in self.slots:
            nodes = nodes_of(slot)
            flat = [n for n in nodes if n not in curved]
            if not flat:
                continue
            linear = self.quadratic.restricted(lambda n, flat=flat: n in flat)
            b = Quadratic(self.slots, linear.table).slope_of_data(slot)
            if is_zero(b):
                continue
            self.duals[slot] = self.duals[slot] - b
            self.quadratic = self.quadratic.without(linear)
            self.form = self.form.with_rule("linear term ↦ translation of the conjugate")

    def _constant(self) -> Expr:
        """Minus the terms in data alone that no quadratic group holds."""
        return self.leftover.conjugate({}).constant if self.leftover.table else S.Zero

    # -- merging ---------------------------------------------------------------------------------------------------------------

    def _merge_scalars(self) -> None:
        """A square of the same functional belongs to the function of one scalar."""
        for group in self.groups:
            if not isinstance(group, ScalarGroup) or len(group.direction.parts) != 1:
                continue
            (node,) = group.nodes if len(group.nodes) == 1 else (None,)
            if node is None or any(node in pair for pair in self.quadratic.couplings()):
                continue
            c = self.quadratic.table.get((node, node), S.Zero)
            if c != 0 and not group.function.has(PositivePart) and group.function.diff(E, 2) != 0:
                continue  # x² and another smooth function: a minimum over shares
            if c != 0:
                group.function = group.function + c * E**2
                self.quadratic = Quadratic(
                    self.slots, {k: v for k, v in self.quadratic.table.items() if k != (node, node)}
                )

    def _parted(self, group: Any) -> list[Any]:
        """A function of one scalar without a closed conjugate as the functions it is the sum of, which share the dual."""
        if not isinstance(group, ScalarGroup) or not group.function.is_Add:
            return [group]
        if conjugate_of_one_variable(group.function, E, Symbol("y", real=True)) is not None:
            return [group]
        terms = Add.make_args(group.function)
        linear = Add(*(t for t in terms if t.diff(E, 2) == 0 and not t.has(PositivePart, Maximum)))
        curved = [t for t in terms if t not in Add.make_args(linear)]
        curved[0] = curved[0] + linear
        return [ScalarGroup(self.slots, group.direction, t) for t in curved]

    # -- components ------------------------------------------------------------------------------------------------------------

    def _components(self) -> list[tuple[set[Node], Quadratic | None, list[Any]]]:
        sets: list[set[Node]] = [set(g.nodes) for g in self.groups]
        sets += [set(pair) for pair in self.quadratic.couplings()] + [{n} for n in self.quadratic.curved()]
        merged: list[set[Node]] = []
        for one in sets:
            touching = [m for m in merged if m & one]
            merged = [m for m in merged if not m & one] + [set().union(one, *touching)]
        # trace and deviator of the same slots, quadratic alone, print as one tensor
        plain = [m for m in merged if not any(g.nodes & m for g in self.groups)]
        for m in plain:
            twin = next(
                (o for o in plain if o is not m and o in merged and {n[1] for n in o} & {n[1] for n in m}), None
            )
            if m in merged and twin is not None:
                merged = [o for o in merged if o is not m and o is not twin] + [m | twin]
                plain = [*plain, m | twin]
        found = []
        taken = Quadratic(self.slots)
        for nodes in sorted(merged, key=lambda m: sorted((self.slots.index(n[1]), n[0]) for n in m)):
            part = self.quadratic.restricted(lambda n, nodes=nodes: n in nodes)
            quadratic = part if part.curved() else None
            if quadratic is not None:
                quadratic = self._with_data(quadratic)
                taken = Quadratic(self.slots, {**taken.table, **quadratic.table})
            found.append((nodes, quadratic, [g for g in self.groups if g.nodes <= nodes]))
        self.leftover = self.quadratic.without(taken)
        return found

    def _with_data(self, part: Quadratic) -> Quadratic:
        """The part and the terms in its data alone, so that a complete square is seen as one."""
        data = {n for pair in part.table for n in pair if not part.is_slot(n)}
        blocks = {n[0] for pair in part.table for n in pair}
        kept = dict(part.table)
        for pair, c in self.quadratic.table.items():
            if any(self.quadratic.is_slot(n) for n in pair) or pair in kept:
                continue
            if all(n in data for n in pair) and pair[0][0] in (*blocks, "one") and pair not in self._taken:
                kept[pair] = c
                self._taken.add(pair)
        return Quadratic(self.slots, kept)

    # -- one component ---------------------------------------------------------------------------------------------------------

    def _component(self, quadratic: Quadratic | None, groups: list[Any]) -> MinForm:
        quadratic, groups = self._absorbed(quadratic, groups)
        members = ([QuadraticGroup(quadratic)] if quadratic is not None else []) + groups
        if len(members) == 1:
            return members[0].conjugate(self.duals)
        return self._convolution(members)

    def _unilateral(self, groups: list[Any]) -> list[Any]:
        """λ/2 ⟨tr T⟩² and μ T^≥:T^≥ of the same tensor."""
        for eigen in [g for g in groups if isinstance(g, EigenGroup)]:
            if eigen.top != 0 or eigen.low != 0:
                continue
            mu = tidy_scalar(eigen.function / PositivePart(E) ** 2)
            for scalar in [g for g in groups if isinstance(g, ScalarGroup)]:
                # the trace of T, normalised as the functional is
                lead = next(s for s in self.slots if s in eigen.parts.linear)
                c = eigen.parts.linear[lead][0]
                trace = {s: identity * (k / c) for s, (k, _) in eigen.parts.linear.items()}
                rest = tr(eigen.parts.rest) if eigen.parts.rest.terms() else S.Zero  # type: ignore[arg-type]
                square = PositivePart(c * E + rest) ** 2
                lam = tidy_scalar(2 * scalar.function / square)
                if not mu.has(E) and not lam.has(E) and scalar.direction.parts == trace:
                    kept = [g for g in groups if g is not eigen and g is not scalar]
                    return self._unilateral([*kept, UnilateralGroup(eigen, lam, mu)])
        return groups

    def _absorbed(self, quadratic: Quadratic | None, groups: list[Any]) -> tuple[Quadratic | None, list[Any]]:
        """k r + c r² of one gauge r, and Σ G(t_i) + c T:T of one tensor, are functions of one quantity."""
        if quadratic is None or len(groups) != 1:
            return quadratic, groups
        group = groups[0]
        if isinstance(group, GaugeGroup):
            ratio = _proportion(quadratic, group.form)
            if ratio is not None:
                gamma = _new_multiplier(self.form)
                self.form = self.form + MinForm(
                    value=gamma**2 / (4 * ratio),
                    unknowns=(gamma,),
                    conditions=(ratio,),
                    rules=("norm and square of a norm: a function of one length",),
                )
                return None, [GaugeGroup(group.weight + gamma, group.form)]
        if isinstance(group, EigenGroup) and group.top == 0 and group.low == 0:
            square = Quadratic(self.slots)
            tensor: Any = group.parts.rest
            for slot, (c, _) in group.parts.linear.items():
                tensor = tensor + slot * c
            square.add_inner(S.One, tensor, tensor)
            ratio = _proportion(quadratic, square.tidied())
            if ratio is not None:
                return None, [EigenGroup(self.slots, group.parts, group.function + ratio * E**2)]
        return quadratic, groups

    # -- infimal convolution -----------------------------------------------------------------------------------------------------

    def _convolution(self, members: list[Any]) -> MinForm:
        shared = [s for s in self.slots if sum(any(n[1] == s for n in m.nodes) for m in members) > 1]
        marks = _marks(members)
        total = MinForm(rules=("functions of the same variable: infimal convolution, a minimum over shares",))
        tables = [dict(self.duals) for _ in members]
        for slot in shared:
            owners = [k for k, m in enumerate(members) if any(n[1] == slot for n in m.nodes)]
            rest: Any = None
            for k in owners:
                kinds = {n[0] for n in members[k].nodes if n[1] == slot}
                unknown, share = self._share(slot, marks[k], kinds)
                total = total + MinForm(unknowns=(unknown,))
                tables[k][slot] = share
                rest = share if rest is None else rest + share
            kinds = {n[0] for k in owners for n in members[k].nodes if n[1] == slot}
            missing: Any = rest - self.duals[slot]
            if kinds == {"tr"}:
                missing = tr(missing)
            elif kinds == {"dev"}:
                missing = dev(missing)
            total = total + MinForm(equalities=(missing,))
        for k, member in enumerate(members):
            part = member.conjugate(tables[k])
            phases = ()
            if len(shared) == 1:
                phases = (Phase(tables[k][shared[0]], part.value, part.inequalities, part.equalities, part.cases),)
            total = total + replace(part, cases=(), phases=phases)
        return total

    def _share(self, slot: Any, mark: str, kinds: set[str]) -> tuple[Any, Any]:
        """A new unknown and the share of the dual it stands for."""
        base = getattr(self.named[slot], "name", getattr(slot, "name", "y")).removesuffix("_star")
        name = f"{base}_{mark}"
        if not isinstance(slot, Ranked):
            unknown: Any = ScalarVariable(name)
            return unknown, unknown
        if slot.rank == 1:
            unknown = VectorSymbol(name)
            return unknown, unknown
        if kinds == {"tr"}:
            unknown = ScalarVariable(name)
            return unknown, identity * unknown
        unknown = TensorSymbol(name)
        return unknown, unknown

    def _untouched(self, slot: Any, touched: set[Node]) -> None:
        dual = self.duals[slot]
        free = [n for n in nodes_of(slot) if n not in touched]
        if not free:
            return
        residuals = [dual]
        if len(free) < len(nodes_of(slot)):
            residuals = [tr(dual) if free[0][0] == "tr" else dev(dual)]
        elif isinstance(dual, Ranked) and dual.rank == 2 and dual.atoms(Multiplier):
            residuals = [tr(dual), dev(dual)]  # the trace may determine the multiplier
        self.form = self.form + MinForm(equalities=tuple(r for r in residuals if not is_zero(r)))


def _proportion(a: Quadratic, b: Quadratic) -> Expr | None:
    """c with a = c b as functions, data included."""
    if set(a.table) != set(b.table) or not b.table:
        return None
    ratios = {tidy_scalar(a.table[k] / b.table[k]) for k in b.table}
    (c, *others) = ratios
    return None if others else c


def _new_multiplier(form: MinForm) -> Any:
    count = sum(isinstance(u, Multiplier) for u in form.unknowns)
    return Multiplier("gamma" if count == 0 else f"gamma_{count + 1}")


def _marks(members: list[Any]) -> list[str]:
    """A mark per member: the suffix that its parameters share (`E_s`, `nu_s` give s), else its number."""
    found = []
    for member in members:
        suffixes = {p.name.rpartition("_")[2] if "_" in p.name else "" for p in _parameters(member)}
        found.append(next(iter(suffixes)) if len(suffixes) == 1 else "")
    if all(found) and len(set(found)) == len(found):
        return found
    return [str(k + 1) for k in range(len(members))]


def _parameters(member: Any) -> set[Any]:
    if isinstance(member, QuadraticGroup):
        expressions = [
            c for (a, b), c in member.form.table.items() if member.form.is_slot(a) and member.form.is_slot(b)
        ]
    elif isinstance(member, GaugeGroup):
        expressions = [member.weight, *member.form.table.values()]
    elif isinstance(member, UnilateralGroup):
        expressions = [member.lam, member.mu]
    else:
        expressions = [member.function, *(getattr(member, k, S.Zero) for k in ("top", "low"))]
    return {p for e in expressions for p in e.free_symbols if isinstance(p, Parameter)}
