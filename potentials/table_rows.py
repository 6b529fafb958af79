"""The rows of Table 1, one method per group.

Flux slots are (ε̇^ir or ε̇, α̇_m, −q/T), force slots (σ or σ^ir, A_m, ∇T). The force form is that of the total conjugate, in which every rate
enters with a plus sign; the minus signs that are printed in the reference study's force column hold for the conjugate in the first slot.
"""

from __future__ import annotations

from typing import Any

from sympy import Expr, Pow, S, latex, sstr

from .atoms.eig_max import EigMaxLeaf
from .atoms.eig_min import EigMinLeaf
from .atoms.maximum import Maximum
from .atoms.norm import NormLeaf
from .atoms.positive_part import PositivePart
from .atoms.positive_trace import PositiveTraceLeaf
from .conjugation.conjugate import Conjugate, conjugate
from .conjugation.laws import dual_of, slots_of
from .conjugation.quadratic import gathered
from .conjugation.slots import mentions
from .conjugation.wording import Words, comparison, joined, shown, value_words
from .derivative import partial
from .extended import Extended
from .law import Law, Variable
from .names import latex_name
from .ranked import Ranked
from .roles import entropy_flux, rates
from .table import Row
from .tensor import TensorSymbol, sym_tensor
from .vector import VectorSymbol

__all__ = ["Writer"]

KINKS = (NormLeaf, EigMaxLeaf, EigMinLeaf, PositiveTraceLeaf, Maximum, PositivePart)


class _HeatFlux(VectorSymbol):
    """−q/T, as the reader knows it."""

    __slots__ = ()

    def _shown(self, printer: Any, latex: bool) -> str:
        return r"\left(-\boldsymbol{q}/T\right)" if latex else "(-q/T)"


class Writer:
    """Rows of one law; `irreversible` is None in the total split, else the tensors whose sum is ε^ir."""

    def __init__(self, law: Law, irreversible: tuple[TensorSymbol, ...] | None) -> None:
        self.law = law
        self.reversible = irreversible is not None
        self.irreversible = irreversible or ()
        self.viscous = law.observable in law.forces
        self.strain = sym_tensor(f"{law.observable.name}_r") if self.irreversible else law.observable
        self.rho, self.rho_row = self._density()
        self.duals = {s: self._dual(s) for s in slots_of(law)}

    def rows(self, formulation: str) -> list[Row]:
        """All rows that exist for the law."""
        state = self._strain_rows() if formulation == "strain" else self._stress_rows()
        return [
            *self._opening(),
            *self.rho_row,
            *state,
            *self._rate_form(),
            *self._force_form(),
            *self._notes(formulation),
        ]

    # -- names -----------------------------------------------------------------------------------------------------------------

    def _density(self) -> tuple[Expr, list[Row]]:
        rho = self.law.density
        if rho is None:
            return S.One, []
        (text, tex) = shown(rho)
        return rho, [
            Row(
                "density",
                f"rho = {text}, potentials per unit mass",
                rf"\rho = {tex},\ \text{{potentials per unit mass}}",
            )
        ]

    def _dual(self, slot: Any) -> Any:
        found = dual_of(slot, self.law)
        return _HeatFlux(found.name) if found == self._flux else found

    @property
    def _flux(self) -> Any:
        return None if self.law.temperature is None else entropy_flux(self.law.temperature)

    def _pairs(self) -> dict[Any, tuple[Any, Any]]:
        """(rate, force) symbols by variable, for the slots of φ and φ*."""
        found = {}
        for slot, dual in self.duals.items():
            first = _HeatFlux(slot.name) if slot == self._flux else slot
            found[slot.variable] = (first, dual) if slot.role == "rate" else (dual, first)
        return found

    def _rate(self, variable: Any) -> Words:
        pair = self._pairs().get(variable)
        return _bare(shown(pair[0] if pair is not None else rates(variable)))

    def _force(self, variable: Variable) -> Words:
        pair = self._pairs().get(variable)
        base = shown(pair[1]) if pair is not None else (f"A_{variable.name}", rf"A_{{{latex_name(variable.name)}}}")
        return (f"{base[0]}_r", rf"{base[1]}^{{r}}") if variable in self.irreversible else base

    def _stress(self) -> Words:
        """The stress of the state law."""
        if self.viscous:
            return "sig_r", r"\boldsymbol{\sigma}^{r}"
        return ("sig", r"\boldsymbol{\sigma}")

    def _viscous_stress(self) -> Words:
        return shown(self._pairs()[self.law.observable][1]) if self.viscous else ("sig_ir", r"\boldsymbol{\sigma}^{ir}")

    # -- decomposition and dissipation ---------------------------------------------------------------------------------------------

    def _opening(self) -> list[Row]:
        eps, tex = shown(self.law.observable)
        stress, stress_tex = self._viscous_stress()
        total = (f"sig = sig_r + {stress}", rf"\boldsymbol{{\sigma}} = \boldsymbol{{\sigma}}^{{r}} + {stress_tex}")
        if not self.reversible:
            if not self.viscous:
                total = (f"{total[0]}, {stress} = 0", rf"{total[1]},\ {stress_tex} = 0")
            return [Row("decomposition", *total), self._dissipation()]
        if self.irreversible:
            names = joined((shown(x) for x in self.irreversible), " + ", " + ")
            split = (f"{eps} = {eps}_r + {names[0]}", rf"{tex} = {tex}^{{r}} + {names[1]}")
            if len(self.irreversible) > 1:
                split = (
                    f"{eps} = {eps}_r + {eps}_ir, {eps}_ir = {names[0]}",
                    rf"{tex} = {tex}^{{r}} + {tex}^{{ir}},\ {tex}^{{ir}} = {names[1]}",
                )
        else:
            split = (f"{eps} = {eps}_r, {eps}_ir = 0", rf"{tex} = {tex}^{{r}},\ {tex}^{{ir}} = 0")
        if self.viscous:
            split = joined([split, total])
        return [Row("decomposition", *split), self._dissipation()]

    def _dissipation(self) -> Row:
        products = []
        if self.viscous:
            products.append(_product(self._viscous_stress(), self._rate(self.law.observable), 2))
        products += [_product(self._stress(), self._rate(x), 2) for x in self.irreversible]
        for v in self.law.internal:
            products.append(_product(self._force(v), self._rate(v), v.rank if isinstance(v, Ranked) else 0))
        if self.law.temperature in self._pairs():
            products.append(_product(("-q/T", r"-\frac{\boldsymbol{q}}{T}"), self._force(self.law.temperature), 1))  # type: ignore[arg-type]
        text, tex = joined(products, " + ", " + ") if products else ("0", "0")
        tex = tex.replace("+ -", "- ")
        return Row("dissipation inequality", f"{text} >= 0", rf"{tex} \geq 0")

    # -- state laws ----------------------------------------------------------------------------------------------------------------

    def _written(self, expression: Any) -> Any:
        """A potential in the observable of the split."""
        if not self.irreversible:
            return expression
        total: Any = self.strain
        for x in self.irreversible:
            total = total + x
        return expression.xreplace({self.law.observable: total})

    def _derivative(self, potential: str, symbol: Any, sign: str = "", scaled: bool = True) -> Words:
        """[ρ] ∂potential/∂symbol with a sign."""
        name, tex = shown(symbol)
        letter = {"psi": r"\psi", "psi_star": r"\psi^{*}"}[potential]
        factor = ("rho*", r"\rho\,") if self.rho != 1 and scaled else ("", "")
        return f"{sign}{factor[0]}d{potential}/d{name}", rf"{sign}{factor[1]}\partial_{{{tex}}}{letter}"

    def _strain_rows(self) -> list[Row]:
        law = self.law
        stress = self._stress() if self.reversible else ("sig_r", r"\boldsymbol{\sigma}^{r}")
        if law.psi is None:
            found = self._energy_of_conjugate()
            if not (found.closed and found.has_gradient and not found.domain and not found.equalities):
                return self._strain_rows_by_supremum(found, stress)
        psi = self._written(law.psi if law.psi is not None else law.energy / self.rho)
        rows = [_equation("free energy", ("psi", r"\psi"), psi)]
        value = partial(psi, self.strain) * self.rho
        rows.append(_equation("state law", stress, value, self._derivative("psi", self.strain)))
        if law.temperature is not None:
            slope = self._derivative("psi", law.temperature, scaled=False)
            rows.append(_equation("state law", ("-s", "-s"), gathered(partial(psi, law.temperature)), slope))
        for v in law.internal:
            value = partial(psi, v) * (-self.rho)
            rows.append(_equation("state law", self._force(v), value, self._derivative("psi", v, "-")))
        return rows

    def _energy_of_conjugate(self) -> Conjugate:
        declared = self.law.psi_star * self.rho
        return conjugate(Extended(declared), {self.law.stress_symbol: self.law.observable})

    def _strain_rows_by_supremum(self, found: Conjugate, stress: Words) -> list[Row]:
        law = self.law
        text, tex = found.words()
        body = (f"psi = {text}", rf"\psi = {tex}") if self.rho == 1 else (f"rho*psi = {text}", rf"\rho\psi = {tex}")
        rows = [Row("free energy", *body)]
        name, name_tex = shown(law.observable)
        rows.append(Row("state law", f"{stress[0]} in dpsi/d{name}", rf"{stress[1]} \in \partial_{{{name_tex}}}\psi"))
        if law.temperature is not None:
            value = -partial(law.psi_star, law.temperature)
            rows.append(
                _equation("state law", ("-s", "-s"), value, self._derivative("psi", law.temperature, scaled=False))
            )
        for v in law.internal:
            value = partial(law.psi_star, v) * self.rho
            if v in self.irreversible:
                value = value - law.stress_symbol  # type: ignore[operator]
            rows.append(_equation("state law", self._force(v), value, self._derivative("psi", v, "-")))
        return rows

    # -- stress formulation ----------------------------------------------------------------------------------------------------------

    def _conjugate_energy(self) -> tuple[Conjugate | None, Any, Any]:
        """(conjugate object or None, ρψ* where it is an expression, the stress symbol)."""
        law = self.law
        if law.psi is None:
            value: Any = law.psi_star * self.rho
            for x in self.irreversible:
                from .invariants import inner

                value = value - inner(law.stress_symbol, x)  # type: ignore[arg-type]
            return None, value, law.stress_symbol
        stress = sym_tensor(self._stress()[0])
        found = conjugate(Extended(self._written(law.energy)), {self.strain: stress})
        return found, None if found.form is None else found.form.value, stress

    def _stress_rows(self) -> list[Row]:
        found, value, stress = self._conjugate_energy()
        strain = shown(self.strain)
        phases = () if found is None else found.phases
        named = bool(phases) and all(isinstance(p.share, TensorSymbol) for p in phases)
        rows = self._energy_rows(found, value, named)
        if named:
            for phase in phases:
                smooth = not phase.inequalities and not phase.equalities and _is_smooth(phase.value, phase.share)
                if smooth:
                    slope = self._derivative("psi_star", phase.share)
                    rows.append(_equation("state law", strain, partial(phase.value, phase.share), slope))
                else:
                    name = _phase_name(phase.share)
                    rows.append(Row("state law", f"{strain[0]} in d{name[0]}", rf"{strain[1]} \in \partial {name[1]}"))
        else:
            closed = found is None or (
                found.closed and found.has_gradient and not found.domain and not found.equalities
            )
            slope = self._derivative("psi_star", stress)
            if closed and _is_smooth(value, stress):
                rows.append(_equation("state law", strain, partial(value, stress), slope))
            else:
                rows.append(Row("state law", f"{strain[0]} in {slope[0]}", rf"{strain[1]} \in {slope[1]}"))
        return [*rows, *self._envelope_rows(found, value, stress)]

    def _energy_rows(self, found: Conjugate | None, value: Any, named: bool) -> list[Row]:
        name = ("psi_star", r"\psi^{*}") if self.rho == 1 else ("rho*psi_star", r"\rho\psi^{*}")
        if found is None:
            return [_equation("conjugate energy", ("psi_star", r"\psi^{*}"), value / self.rho)]
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
        psi = self._written(law.energy)
        if value is None:
            name, tex = shown(self.strain)
            at = (f" at the {name} of the supremum", rf"\ \text{{at the }} {tex} \text{{ of the supremum}}")
        if law.temperature is not None:
            slope = -partial(psi, law.temperature) if value is None else partial(value, law.temperature)
            row = _equation(
                "state law",
                ("s", "s"),
                gathered(slope / self.rho),
                self._derivative("psi_star", law.temperature, scaled=False),
            )
            rows.append(Row(row.title, row.text + at[0], row.tex + at[1]))
        for v in law.internal:
            slope = -partial(psi, v) if value is None else partial(value, v)
            row = _equation("state law", self._force(v), slope, self._derivative("psi_star", v))
            rows.append(Row(row.title, row.text + at[0], row.tex + at[1]))
        return rows

    # -- complementary laws ------------------------------------------------------------------------------------------------------------

    def _dissipation_potentials(self) -> tuple[Words, Conjugate, bool]:
        """Declared potential in words, the other one, and whether φ is the declared one."""
        law = self.law
        declared = law.phi if law.phi is not None else law.phi_star
        assert declared is not None
        table = {self._flux: _HeatFlux(self._flux.name)} if self._flux is not None else {}
        plain = declared.map(lambda e: e.xreplace(table))
        slots = {table.get(s, s): d for s, d in self.duals.items()}
        return (str(plain), plain.latex()), conjugate(plain, slots), law.phi is not None

    def _rate_form(self) -> list[Row]:
        if not self.duals:
            return []
        declared, other, is_phi = self._dissipation_potentials()
        pairs = self._pairs()
        arguments = joined((_bare(shown(r)) for r, _ in pairs.values()))
        name = (f"phi({arguments[0]})", rf"\varphi\left({arguments[1]}\right)")
        body = declared if is_phi else other.words()
        rows = [Row("dissipation potential", f"{name[0]} = {body[0]}", rf"{name[1]} = {body[1]}")]
        for variable, (rate, force) in pairs.items():
            left = self._driving(variable, force)
            a, at = _bare(shown(rate))
            slope = (f"dphi/d{a}" if "/" not in a else f"dphi/d({a})", rf"\partial_{{{at}}}\varphi")
            value = self._smooth_slope(other, is_phi, rate)
            if value is None:
                rows.append(Row("rate form", f"{left[0]} in {slope[0]}", rf"{left[1]} \in {slope[1]}"))
            else:
                rows.append(_equation("rate form", left, value, slope))
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
        if any(mentions(c, {rate}) for c in constraints) or not _is_smooth(value, rate):
            return None
        return partial(value, rate)

    def _driving(self, variable: Any, force: Any) -> Words:
        """Left side of the rate form: the force, and in the reversible split what it is made of."""
        a, at = shown(force)
        if variable in self.irreversible:
            r, rt = self._force(variable)
            s, st = self._stress()
            return f"{a} = {s} + {r}", rf"{at} = {st} + {rt}"
        return a, at

    def _force_form(self) -> list[Row]:
        law, pairs = self.law, self._pairs()
        if not pairs:
            return [_equation("complementary law", self._rate(v), 0) for v in law.internal]
        rows: list[Row] = []
        for v in self.irreversible:
            if v in pairs:
                rows.append(Row("driving force", *self._driving(v, pairs[v][1])))
        declared, other, is_phi = self._dissipation_potentials()
        arguments, fluxes = (
            joined(shown(f) for _, f in pairs.values()),
            joined(_bare(shown(r)) for r, _ in pairs.values()),
        )
        name = (f"phi_star({arguments[0]})", rf"\varphi^{{*}}\left({arguments[1]}\right)")
        body = other.words() if is_phi else declared
        rows.append(Row("force function", f"{name[0]} = {body[0]}", rf"{name[1]} = {body[1]}"))
        potential = self._force_function(other, is_phi)
        surfaces = () if potential is None else potential.surfaces
        marks = [""] if len(surfaces) == 1 else [str(j + 1) for j in range(len(surfaces))]
        for mark, f in zip(marks, surfaces, strict=False):
            rows.append(Row("elastic domain", f"f{mark} = {sstr(f)} <= 0", rf"f{_sub(mark)} = {latex(f)} \leq 0"))
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
            table = {self._flux: _HeatFlux(self._flux.name)} if self._flux is not None else {}
            found = self.law.phi_star
            return None if found is None else found.map(lambda e: e.xreplace(table))
        if not other.closed or not other.has_gradient or other.equalities:
            return None
        return other.extended()

    def _flow_rows(self, potential: Extended, marks: list[str]) -> list[Row]:
        law, pairs, rows = self.law, self._pairs(), []
        order = (*((law.observable,) if self.viscous else ()), *law.internal)
        order = (*order, law.temperature) if law.temperature in pairs else order
        for v in order:
            left = self._rate(v)
            if v not in pairs:
                rows.append(_equation("complementary law", left, 0))
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
                    texs.append(rf"\gamma{_sub(mark)}\left({latex(slope)}\right)")
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
                    rf"\gamma{_sub(mark)} \geq 0,\ f{_sub(mark)} \leq 0,\ \gamma{_sub(mark)} f{_sub(mark)} = 0",
                )
            )
        return rows

    # -- notes -------------------------------------------------------------------------------------------------------------------------

    def _notes(self, formulation: str) -> list[Row]:
        rows = []
        if len(self.duals) > 1:
            text = (
                "phi_star is the total conjugate of phi: every rate is +dphi_star/dforce; the conjugate in the first slot alone "
                "has the opposite sign in the other slots"
            )
            tex = (
                r"\varphi^{*} \text{ is the total conjugate: every rate is } +\partial\varphi^{*}\text{; the conjugate in the first "
                r"slot alone has the opposite sign in the others}"
            )
            rows.append(Row("note", text, tex))
        if self.law.temperature is not None and formulation == "strain":
            text = (
                "psi is concave in the temperature: its subdifferential there is that of -psi, with the opposite sign"
            )
            tex = r"\psi \text{ is concave in the temperature: } -\partial(-\psi) \text{ is meant there}"
            rows.append(Row("note", text, tex))
        return rows


def _bare(words: Words) -> Words:
    """−q/T without its parentheses."""
    return ("-q/T", r"-\boldsymbol{q}/T") if words[0] == "(-q/T)" else words


def _product(force: Words, rate: Words, rank: int) -> Words:
    if rank == 0:
        return f"{force[0]}*{rate[0]}", rf"{force[1]}\,{rate[1]}"
    sign = ":" if rank == 2 else r"\cdot "
    return f"inner({force[0]}, {rate[0]})", f"{force[1]}{sign}{rate[1]}"


def _equation(title: str, left: Words, value: Any, middle: Words = ("", "")) -> Row:
    text, tex = ("0", "0") if isinstance(value, int) and value == 0 else shown(value)
    between = (f"{middle[0]} = ", f"{middle[1]} = ") if middle[0] else ("", "")
    return Row(title, f"{left[0]} = {between[0]}{text}", f"{left[1]} = {between[1]}{tex}")


def _phase_name(share: TensorSymbol) -> Words:
    mark = share.name.partition("_")[2].removeprefix("r_")
    return f"psi_{mark}_star({share})", rf"\psi_{{{mark}}}^{{*}}\left({latex(share)}\right)"


def _sub(mark: str) -> str:
    return f"_{{{mark}}}" if mark else ""


def _is_smooth(expression: Any, symbol: Any) -> bool:
    """True if no node with a kink, other than under a power above one, stands over the symbol."""
    if not mentions(expression, {symbol}):
        return True
    if isinstance(expression, Pow) and isinstance(expression.base, KINKS):
        if expression.exp.is_number and not expression.exp > 1:
            return False
        return not isinstance(expression.base, (PositivePart, Maximum)) or all(
            _is_smooth(a, symbol) for a in expression.base.args
        )
    if isinstance(expression, Pow) and expression.exp == S.Half:
        return False
    if isinstance(expression, KINKS):
        return False
    return isinstance(expression, Ranked) or all(_is_smooth(a, symbol) for a in expression.args)
