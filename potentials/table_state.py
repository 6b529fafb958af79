"""State laws of Table 1: the free energy and its derivatives, or its partial conjugate and the derivatives of that."""

from __future__ import annotations

from typing import Any

from sympy import S, expand_mul, latex

from .conjugation.conjugate import Conjugate, conjugate
from .conjugation.laws import conjugate_of_stress_potential
from .conjugation.quadratic import gathered
from .conjugation.wording import Words, comparison, joined, shown, value_words
from .derivative import partial
from .extended import Extended
from .invariants import inner
from .table import Row
from .table_notation import Notation, equation, is_smooth
from .tensor import TensorSymbol, sym_tensor

__all__ = ["StateRows"]


class StateRows:
    """Rows of the state laws in either formulation."""

    def __init__(self, notation: Notation) -> None:
        self.notation = notation
        self.law = notation.law
        self.rho = notation.rho
        self.irreversible = notation.irreversible
        self.strain = notation.strain

    def strain_form(self) -> list[Row]:
        law = self.law
        stress = self.notation.stress() if self.notation.reversible else ("sig_r", r"\boldsymbol{\sigma}^{r}")
        if law.psi is None:
            found, _ = conjugate_of_stress_potential(law)
            if not (found.closed and found.has_gradient and not found.domain and not found.equalities):
                return self._strain_rows_by_supremum(stress)
        psi = self.notation.written(law.psi if law.psi is not None else law.energy / self.rho)
        rows = [equation("free energy", ("psi", r"\psi"), psi)]
        value = partial(psi, self.strain) * self.rho
        rows.append(equation("state law", stress, value, self.notation.derivative("psi", self.strain)))
        if law.temperature is not None:
            slope = self.notation.derivative("psi", law.temperature, scaled=False)
            rows.append(equation("state law", ("-s", "-s"), gathered(expand_mul(partial(psi, law.temperature))), slope))
        for v in law.internal:
            value = partial(psi, v) * (-self.rho)
            rows.append(equation("state law", self.notation.force(v), value, self.notation.derivative("psi", v, "-")))
        return rows

    def _strain_rows_by_supremum(self, stress: Words) -> list[Row]:
        law = self.law
        found = conjugate(Extended(law.psi_star * self.rho), {law.stress_symbol: law.observable})
        text, tex = found.words()
        body = (f"psi = {text}", rf"\psi = {tex}") if self.rho == 1 else (f"rho*psi = {text}", rf"\rho\psi = {tex}")
        rows = [Row("free energy", *body)]
        name, name_tex = shown(law.observable)
        rows.append(Row("state law", f"{stress[0]} in dpsi/d{name}", rf"{stress[1]} \in \partial_{{{name_tex}}}\psi"))
        if law.temperature is not None:
            value = -partial(law.psi_star, law.temperature)
            rows.append(
                equation(
                    "state law", ("-s", "-s"), value, self.notation.derivative("psi", law.temperature, scaled=False)
                )
            )
        for v in law.internal:
            value = partial(law.psi_star, v) * self.rho
            if v in self.irreversible:
                value = value - law.stress_symbol  # type: ignore[operator]
            rows.append(equation("state law", self.notation.force(v), value, self.notation.derivative("psi", v, "-")))
        return rows

    # -- stress formulation ----------------------------------------------------------------------------------------------------------

    def _conjugate_energy(self) -> tuple[Conjugate | None, Any, Any]:
        """(conjugate object or None, ρψ* where it is an expression, the stress symbol)."""
        law = self.law
        if law.psi is None:
            value: Any = law.psi_star * self.rho
            for x in self.irreversible:
                value = value - inner(law.stress_symbol, x)  # type: ignore[arg-type]
            return None, value, law.stress_symbol
        stress = sym_tensor(self.notation.stress()[0])
        found = conjugate(Extended(self.notation.written(law.energy)), {self.strain: stress})
        return found, None if found.form is None else found.form.value, stress

    def stress_form(self) -> list[Row]:
        found, value, stress = self._conjugate_energy()
        strain = shown(self.strain)
        phases = () if found is None else found.phases
        named = bool(phases) and all(isinstance(p.share, TensorSymbol) for p in phases)
        rows = self._energy_rows(found, value, named)
        if named:
            for phase in phases:
                smooth = not phase.inequalities and not phase.equalities and is_smooth(phase.value, phase.share)
                if smooth:
                    slope = self.notation.derivative("psi_star", phase.share)
                    rows.append(equation("state law", strain, partial(phase.value, phase.share), slope))
                else:
                    name = _phase_name(phase.share)
                    rows.append(Row("state law", f"{strain[0]} in d{name[0]}", rf"{strain[1]} \in \partial {name[1]}"))
        else:
            closed = found is None or (
                found.closed and found.has_gradient and not found.domain and not found.equalities
            )
            slope = self.notation.derivative("psi_star", stress)
            if closed and is_smooth(value, stress):
                rows.append(equation("state law", strain, partial(value, stress), slope))
            else:
                rows.append(Row("state law", f"{strain[0]} in {slope[0]}", rf"{strain[1]} \in {slope[1]}"))
        return [*rows, *self._envelope_rows(found, value, stress)]

    def _energy_rows(self, found: Conjugate | None, value: Any, named: bool) -> list[Row]:
        name = ("psi_star", r"\psi^{*}") if self.rho == 1 else ("rho*psi_star", r"\rho\psi^{*}")
        if found is None:
            return [equation("conjugate energy", ("psi_star", r"\psi^{*}"), value / self.rho)]
        if not named:
            rows = [Row("conjugate energy", *found.words(name))]
            return rows + [Row("case", *case) for case in found.cases]
        assert found.form is not None
        phases = found.phases
        names = [_phase_name(p.share) for p in phases]
        shares, total = joined((shown(p.share) for p in phases), " + ", " + "), shown(next(iter(found.duals.values())))
        inside = joined(names, " + ", " + ")
        rest = gathered(found.form.value - sum((p.value for p in phases), S.Zero))
        minus = ("", "")
        if rest != 0:
            (a, at) = shown(-rest)
            minus = (f" - ({a})", rf" - \left({at}\right)")
        rows = [
            Row(
                "conjugate energy",
                f"{name[0]} = min over {shares[0]} = {total[0]} of {{{inside[0]}}}{minus[0]}",
                rf"{name[1]} = \min_{{{shares[1]} = {total[1]}}}\left\{{{inside[1]}\right\}}{minus[1]}",
            )
        ]
        for phase, (text, tex) in zip(phases, names, strict=True):
            (body, body_tex), definitions = value_words(phase.value)
            conditions = [comparison(e, "=") for e in phase.equalities] + [
                comparison(f, "<=") for f in phase.inequalities
            ]
            if conditions:
                where = joined(conditions)
                body = f"{body} if {where[0]}, else +oo"
                body_tex = rf"{body_tex} \quad\text{{if }} {where[1]},\ \text{{else }} +\infty"
            if definitions:
                also = joined(definitions)
                body, body_tex = f"{body}, with {also[0]}", rf"{body_tex},\quad {also[1]}"
            rows.append(Row("conjugate energy", f"{text} = {body}", rf"{tex} = {body_tex}"))
            rows += [Row("case", f"{text} = {a}", rf"{tex} = {b}") for a, b in phase.cases]
        return rows

    def _envelope_rows(self, found: Conjugate | None, value: Any, stress: Any) -> list[Row]:
        """s = ∂ψ*/∂T and A_m = ρ ∂ψ*/∂α_m; of a supremum or minimum, the derivative where it is attained."""
        law, rows = self.law, []
        at = ("", "")
        psi: Any = None
        if value is None:
            psi = self.notation.written(law.energy)
            name, tex = shown(self.strain)
            at = (f" at the {name} of the supremum", rf"\ \text{{at the }} {tex} \text{{ of the supremum}}")
        if law.temperature is not None:
            slope = -partial(psi, law.temperature) if value is None else partial(value, law.temperature)
            row = equation(
                "state law",
                ("s", "s"),
                gathered(expand_mul(slope / self.rho)),
                self.notation.derivative("psi_star", law.temperature, scaled=False),
            )
            rows.append(Row(row.title, row.text + at[0], row.tex + at[1]))
        for v in law.internal:
            slope = -partial(psi, v) if value is None else partial(value, v)
            row = equation("state law", self.notation.force(v), slope, self.notation.derivative("psi_star", v))
            rows.append(Row(row.title, row.text + at[0], row.tex + at[1]))
        return rows


def _phase_name(share: TensorSymbol) -> Words:
    mark = share.name.partition("_")[2].removeprefix("r_")
    return f"psi_{mark}_star({share})", rf"\psi_{{{mark}}}^{{*}}\left({latex(share)}\right)"
