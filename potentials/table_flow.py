"""Complementary laws of Table 1: the dissipation potential and its rate form, the force function and its force form.

The force form is that of the total conjugate, in which every rate enters with a plus sign; the minus signs that are printed in the
reference study's force column hold for the conjugate in the first slot alone.
"""

from __future__ import annotations

from typing import Any

from sympy import latex, sstr

from .conjugation.conjugate import Conjugate, conjugate
from .conjugation.slots import mentions
from .conjugation.wording import Words, joined, shown
from .derivative import partial
from .extended import Extended
from .ranked import Ranked
from .table import Row
from .table_notation import HeatFlux, Notation, bare, equation, is_smooth, numbered

__all__ = ["FlowRows"]


class FlowRows:
    """Rows of the complementary laws, the same in both formulations."""

    def __init__(self, notation: Notation) -> None:
        self.notation = notation
        self.law = notation.law
        self.irreversible = notation.irreversible

    # -- complementary laws ------------------------------------------------------------------------------------------------------------

    def _dissipation_potentials(self) -> tuple[Words, Conjugate, bool]:
        """Declared potential in words, the other one, and whether φ is the declared one."""
        law = self.law
        declared = law.phi if law.phi is not None else law.phi_star
        assert declared is not None
        table = {self.notation.flux: HeatFlux(self.notation.flux.name)} if self.notation.flux is not None else {}
        plain = declared.map(lambda e: e.xreplace(table))
        slots = {table.get(s, s): d for s, d in self.notation.duals.items()}
        return (str(plain), plain.latex()), conjugate(plain, slots), law.phi is not None

    def rate_form(self) -> list[Row]:
        if not self.notation.duals:
            return []
        declared, other, is_phi = self._dissipation_potentials()
        pairs = self.notation.pairs()
        arguments = joined((bare(shown(r)) for r, _ in pairs.values()))
        name = (f"phi({arguments[0]})", rf"\varphi\left({arguments[1]}\right)")
        body = declared if is_phi else other.words()
        rows = [Row("dissipation potential", f"{name[0]} = {body[0]}", rf"{name[1]} = {body[1]}")]
        for variable, (rate, force) in pairs.items():
            left = self._driving(variable, force)
            a, at = bare(shown(rate))
            slope = (f"dphi/d{a}" if "/" not in a else f"dphi/d({a})", rf"\partial_{{{at}}}\varphi")
            value = self._smooth_slope(other, is_phi, rate)
            if value is None:
                rows.append(Row("rate form", f"{left[0]} in {slope[0]}", rf"{left[1]} \in {slope[1]}"))
            else:
                rows.append(equation("rate form", left, value, slope))
        return rows

    def _smooth_slope(self, other: Conjugate, is_phi: bool, rate: Any) -> Any:
        """∂φ/∂rate where φ is differentiable in it, else None."""
        if is_phi:
            phi = other.function
            value, constraints = phi.finite, phi.surfaces
        elif other.closed and other.has_gradient:
            value, constraints = other.expression, (*other.domain, *other.equalities)
        else:
            return None
        if any(mentions(c, {rate}) for c in constraints) or not is_smooth(value, rate):
            return None
        return partial(value, rate)

    def _driving(self, variable: Any, force: Any) -> Words:
        """Left side of the rate form: the force, and in the reversible split what it is made of."""
        a, at = shown(force)
        if variable in self.irreversible:
            r, rt = self.notation.force(variable)
            s, st = self.notation.stress()
            return f"{a} = {s} + {r}", rf"{at} = {st} + {rt}"
        return a, at

    def force_form(self) -> list[Row]:
        law, pairs = self.law, self.notation.pairs()
        if not pairs:
            return [equation("complementary law", self.notation.rate(v), 0) for v in law.internal]
        rows: list[Row] = []
        for v in self.irreversible:
            if v in pairs:
                rows.append(Row("driving force", *self._driving(v, pairs[v][1])))
        declared, other, is_phi = self._dissipation_potentials()
        arguments, fluxes = (
            joined(shown(f) for _, f in pairs.values()),
            joined(bare(shown(r)) for r, _ in pairs.values()),
        )
        name = (f"phi_star({arguments[0]})", rf"\varphi^{{*}}\left({arguments[1]}\right)")
        body = other.words() if is_phi else declared
        rows.append(Row("force function", f"{name[0]} = {body[0]}", rf"{name[1]} = {body[1]}"))
        potential = self._force_function(other, is_phi)
        surfaces = () if potential is None else potential.surfaces
        marks = [""] if len(surfaces) == 1 else [str(j + 1) for j in range(len(surfaces))]
        for mark, f in zip(marks, surfaces, strict=False):
            rows.append(Row("elastic domain", f"f{mark} = {sstr(f)} <= 0", rf"f{numbered(mark)} = {latex(f)} \leq 0"))
        if potential is not None:
            rows += self._flow_rows(potential, marks)
        text = f"({fluxes[0]}) in d{name[0]}"
        tex = rf"\left({fluxes[1]}\right) \in \partial {name[1]}"
        if surfaces:
            text += ": the normal cone of f <= 0, also at a vertex, where f has no gradient"
            tex += r",\ \text{the normal cone of } f \leq 0"
        rows.append(Row("force form", text, tex))
        return rows

    def _force_function(self, other: Conjugate, is_phi: bool) -> Extended | None:
        if not is_phi:
            table = {self.notation.flux: HeatFlux(self.notation.flux.name)} if self.notation.flux is not None else {}
            found = self.law.phi_star
            return None if found is None else found.map(lambda e: e.xreplace(table))
        if not other.closed or not other.has_gradient or other.equalities:
            return None
        return other.extended()

    def _flow_rows(self, potential: Extended, marks: list[str]) -> list[Row]:
        law, pairs, rows = self.law, self.notation.pairs(), []
        order = (*((law.observable,) if self.notation.viscous else ()), *law.internal)
        order = (*order, law.temperature) if law.temperature in pairs else order
        for v in order:
            left = self.notation.rate(v)
            if v not in pairs:
                rows.append(equation("complementary law", left, 0))
                continue
            force = pairs[v][1]
            parts, texs = [], []
            if mentions(potential.finite, {force}):
                slope = partial(potential.finite, force)
                parts.append(sstr(slope))
                texs.append(latex(slope))
            for mark, f in zip(marks, potential.surfaces, strict=False):
                slope = partial(f, force)
                if slope != 0 and not (isinstance(slope, Ranked) and not slope.terms()):
                    parts.append(f"gamma{mark}*({sstr(slope)})")
                    texs.append(rf"\gamma{numbered(mark)}\left({latex(slope)}\right)")
            rows.append(
                Row(
                    "complementary law",
                    f"{left[0]} = {' + '.join(parts) or '0'}",
                    f"{left[1]} = {' + '.join(texs) or '0'}",
                )
            )
        for mark in marks if potential.surfaces else ():
            rows.append(
                Row(
                    "multiplier",
                    f"gamma{mark} >= 0, f{mark} <= 0, gamma{mark}*f{mark} = 0",
                    rf"\gamma{numbered(mark)} \geq 0,\ f{numbered(mark)} \leq 0,\ \gamma{numbered(mark)} f{numbered(mark)} = 0",
                )
            )
        return rows
