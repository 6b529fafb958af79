"""Rows of Table 1 for a law: dissipation inequality, state laws, complementary laws, in the strain or the stress formulation.

`split="total"`: the observable is the total strain, σ = σ^r + σ^ir with σ^ir = 0. `split="reversible"`: the observable is the
reversible strain ε^r = ε − ε^ir. Laws without temperature have no thermal row. Potentials are per unit volume.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from sympy import latex, sstr

from ..errors import DeclarationError, InputError
from .conjugate import Phase, StressPotential, partial_conjugate
from .derivative import invariants_of, partial
from .invariants import inner
from .law import Law, Variable
from .names import latex_name
from .tensor import SymmetricTensor, TensorSymbol, sym_tensor

__all__ = ["Row", "Table", "build_table"]


@dataclass(frozen=True)
class Row:
    """One row: what it is, as text, as LaTeX."""

    title: str
    text: str
    tex: str


@dataclass(frozen=True)
class Table:
    """A block of Table 1."""

    law: str
    formulation: str
    split: str
    rows: tuple[Row, ...]

    def text(self) -> str:
        """Plain text, one row per line."""
        width = max(len(r.title) for r in self.rows)
        head = f"{self.law}: {self.formulation} formulation, {self.split} split"
        return "\n".join([head, *(f"{r.title:<{width}}  {r.text}" for r in self.rows)])

    def latex(self) -> str:
        """LaTeX, one aligned row per law."""
        rows = [rf"\text{{{r.title}}} & {r.tex} \\" for r in self.rows]
        return "\n".join([r"\begin{array}{ll}", *rows, r"\end{array}"])

    def json(self) -> str:
        """JSON with the same rows."""
        rows = [{"title": r.title, "text": r.text, "latex": r.tex} for r in self.rows]
        return json.dumps(
            {"law": self.law, "formulation": self.formulation, "split": self.split, "rows": rows}, indent=2
        )


def build_table(law: Law, formulation: str, split: str) -> Table:
    """Table of the law; `DeclarationError` says what could not be derived."""
    if formulation not in ("strain", "stress"):
        raise InputError(f"formulation {formulation!r} is not known; it is 'strain' or 'stress'")
    if split not in ("total", "reversible"):
        raise InputError(f"split {split!r} is not known; it is 'total' or 'reversible'")
    irreversible = _irreversible(law) if split == "reversible" else None
    rows = [*_opening(law, irreversible, split)]
    rows += _strain_rows(law, irreversible, split) if formulation == "strain" else _stress_rows(law, irreversible)
    rows += _complementary(law, irreversible)
    return Table(law.name, formulation, split, tuple(rows))


def _irreversible(law: Law) -> TensorSymbol | None:
    eps = law.observable
    found = set()
    for leaf in invariants_of(law.energy):
        for tensor in leaf.args:
            assert isinstance(tensor, SymmetricTensor)
            terms = tensor.terms()
            if terms.get(eps) == 1:
                found |= {a for a, c in terms.items() if a in law.internal and c == -1}
    if not law.internal:
        return None
    if len(found) != 1:
        raise DeclarationError(
            f"law '{law.name}': the reversible split needs psi to hold {eps} - x for one internal tensor x, found {len(found)}"
        )
    (one,) = found
    return one  # type: ignore[return-value]


def _name(variable: Any, dot: bool = False) -> tuple[str, str]:
    tensor = isinstance(variable, TensorSymbol)
    tex = latex_name(variable.name)
    tex = rf"\boldsymbol{{{tex}}}" if tensor else tex
    return (f"d{variable.name}/dt", rf"\dot{{{tex}}}") if dot else (variable.name, tex)


def _product(force: tuple[str, str], variable: Variable) -> tuple[str, str]:
    rate = _name(variable, dot=True)
    if isinstance(variable, TensorSymbol):
        return f"inner({force[0]}, {rate[0]})", rf"{force[1]}:{rate[1]}"
    return f"{force[0]}*{rate[0]}", rf"{force[1]}\,{rate[1]}"


def _force_name(law: Law, variable: Variable, irreversible: TensorSymbol | None) -> tuple[str, str]:
    base = (
        _name(law.forces[variable])
        if variable in law.forces
        else (f"A_{variable.name}", rf"A_{{{latex_name(variable.name)}}}")
    )
    return (f"{base[0]}_r", rf"{base[1]}^{{r}}") if variable == irreversible else base


def _opening(law: Law, irreversible: TensorSymbol | None, block: str) -> list[Row]:
    eps = law.observable.name
    tex = latex_name(eps)
    products = [_product(_force_name(law, v, irreversible), v) for v in law.internal]
    if irreversible is None and block == "reversible":
        split = Row("decomposition", f"{eps} = {eps}_r, {eps}_ir = 0", rf"{tex} = {tex}^{{r}},\ {tex}^{{ir}} = 0")
    elif irreversible is None:
        split = Row(
            "decomposition", "sig = sig_r + sig_ir, sig_ir = 0", r"\sigma = \sigma^{r} + \sigma^{ir},\ \sigma^{ir} = 0"
        )
    else:
        x = _name(irreversible)
        split = Row("decomposition", f"{eps} = {eps}_r + {x[0]}", rf"{tex} = {tex}^{{r}} + {x[1]}")
        rate = _name(irreversible, dot=True)
        products.insert(0, (f"inner(sig, {rate[0]})", rf"\sigma:{rate[1]}"))
    text = " + ".join(t for t, _ in products) or "0"
    formula = " + ".join(t for _, t in products) or "0"
    return [split, Row("dissipation inequality", f"{text} >= 0", rf"{formula} \geq 0")]


def _reversible_energy(law: Law, irreversible: TensorSymbol) -> tuple[Any, TensorSymbol]:
    reversible = sym_tensor(f"{law.observable.name}_r")
    return law.energy.xreplace({law.observable: reversible + irreversible}), reversible


def _strain_rows(law: Law, irreversible: TensorSymbol | None, block: str) -> list[Row]:
    psi, observable = law.energy, law.observable
    stress = ("sig_r", r"\sigma^{r}") if block == "total" else ("sig", r"\sigma")
    if irreversible is not None:
        psi, observable = _reversible_energy(law, irreversible)
    rows = [_equation("free energy", ("psi", r"\psi"), psi)]
    rows.append(
        _equation(
            "state law",
            stress,
            partial(psi, observable),
            f"dpsi/d{observable}",
            rf"\partial_{{{latex(observable)}}}\psi",
        )
    )
    for v in law.internal:
        symbol = _name(v)
        rows.append(
            _equation(
                "state law",
                _force_name(law, v, irreversible),
                -partial(psi, v),
                f"-dpsi/d{symbol[0]}",
                rf"-\partial_{{{symbol[1]}}}\psi",
            )
        )
    return rows


def _equation(title: str, left: tuple[str, str], value: Any, text: str = "", tex: str = "") -> Row:
    shown = sstr(value) if value != 0 else "0"
    return Row(
        title,
        f"{left[0]} = {text + ' = ' if text else ''}{shown}",
        f"{left[1]} = {tex + ' = ' if tex else ''}{latex(value) if value != 0 else '0'}",
    )


def _stress_rows(law: Law, irreversible: TensorSymbol | None) -> list[Row]:
    found: StressPotential = partial_conjugate(law)
    eps = law.observable
    left = (f"{eps.name}_r", rf"{latex_name(eps.name)}^{{r}}") if irreversible is not None else _name(eps)
    energies = [_phase_energy(phase, irreversible) for phase in found.phases]
    inside = (_sum(t for t, _ in energies), _sum(t for _, t in energies))
    if len(found.phases) > 1:
        names = [_name(phase.stress) for phase in found.phases]
        total = (" + ".join(n for n, _ in names), " + ".join(n for _, n in names))
        inside = (
            f"min over {total[0]} = sig of {{{inside[0]}}}",
            rf"\min_{{{total[1]} = \sigma}}\left\{{{inside[1]}\right\}}",
        )
    minus = (
        ("", "")
        if found.internal == 0
        else (f" - ({sstr(found.internal)})", rf" - \left({latex(found.internal)}\right)")
    )
    rows = [Row("conjugate energy", f"psi_star = {inside[0]}{minus[0]}", rf"\psi^{{*}} = {inside[1]}{minus[1]}")]
    if len(found.phases) == 1 and found.phases[0].energy is None and not found.internal:
        rows = []  # the row below says it
    rows += [
        Row("conjugate energy", f"{_phase_name(phase)[0]} = {phase.text}", f"{_phase_name(phase)[1]} = {phase.tex}")
        for phase in found.phases
        if phase.energy is None
    ]
    for phase in found.phases:
        strain = left
        if irreversible is not None and phase.shift is None:
            strain = (f"{left[0]} + {irreversible}", rf"{left[1]} + {latex(irreversible)}")
        if phase.energy is not None:
            base = phase.energy if irreversible is None or phase.shift is None else partial_without_shift(phase)
            tex = r"\partial_{" + latex(phase.stress) + r"}\psi^{*}"
            rows.append(_equation("state law", strain, partial(base, phase.stress), f"dpsi_star/d{phase.stress}", tex))
        else:
            name = _phase_name(phase)
            rows.append(Row("state law", f"{strain[0]} in d{name[0]}", rf"{strain[1]} \in \partial {name[1]}"))
    for v in law.internal:
        name, symbol = _force_name(law, v, irreversible), _name(v)
        value: Any = -partial(found.internal, v)
        for phase in found.phases:
            if phase.energy is not None and irreversible is None and isinstance(v, TensorSymbol):
                value = value + partial(phase.energy, v)
            elif irreversible == v and phase.shift is None:
                value = value - phase.stress
        rows.append(
            _equation("state law", name, value, f"dpsi_star/d{symbol[0]}", rf"\partial_{{{symbol[1]}}}\psi^{{*}}")
        )
    return rows


def partial_without_shift(phase: Phase) -> Any:
    """Conjugate of the phase in its reversible strain: the term σ:x falls away."""
    return phase.energy - inner(phase.stress, phase.shift) if phase.shift is not None else phase.energy


def _phase_name(phase: Phase) -> tuple[str, str]:
    mark = phase.stress.name.removeprefix("sig").strip("_")
    text = f"psi_{mark}_star" if mark else "psi_star"
    return f"{text}({phase.stress})", rf"\psi{_sub(mark)}^{{*}}({latex(phase.stress)})"


def _sum(parts: Iterable[str]) -> str:
    return " + ".join(parts).replace("+ -", "- ")


def _phase_energy(phase: Phase, irreversible: TensorSymbol | None) -> tuple[str, str]:
    text, tex = (phase.text, phase.tex) if phase.energy is not None else _phase_name(phase)
    if irreversible is None:
        return text, tex
    if phase.shift is not None:
        energy = partial_without_shift(phase)
        return sstr(energy), latex(energy)
    return f"{text} - inner({phase.stress}, {irreversible})", rf"{tex} - {latex(phase.stress)}:{latex(irreversible)}"


def _sub(mark: str) -> str:
    return f"_{{{mark}}}" if mark else ""


def _complementary(law: Law, irreversible: TensorSymbol | None) -> list[Row]:
    rows = []
    shown_surfaces = law.surfaces
    if irreversible is not None and irreversible in law.forces:
        name = _force_name(law, irreversible, irreversible)
        force = law.forces[irreversible]
        rows.append(Row("driving force", f"{force} = sig + {name[0]}", rf"{latex(force)} = \sigma + {name[1]}"))
    for j, f in enumerate(shown_surfaces):
        mark = "" if len(shown_surfaces) == 1 else str(j + 1)
        rows.append(Row("elastic domain", f"f{mark} = {sstr(f)} <= 0", rf"f{_sub(mark)} = {latex(f)} \leq 0"))
    for v in law.internal:
        rate = _name(v, dot=True)
        parts, texs = [], []
        for j, f in enumerate(shown_surfaces):
            if v not in law.forces:
                continue
            slope = partial(f, law.forces[v])
            mark = "" if len(shown_surfaces) == 1 else str(j + 1)
            if slope != 0:
                parts.append(f"gamma{mark}*({sstr(slope)})")
                texs.append(rf"\gamma{_sub(mark)}\left({latex(slope)}\right)")
        rows.append(
            Row(
                "complementary law", f"{rate[0]} = {' + '.join(parts) or '0'}", f"{rate[1]} = {' + '.join(texs) or '0'}"
            )
        )
    if shown_surfaces:
        rows.append(Row("multiplier", "gamma >= 0, f <= 0, gamma*f = 0", r"\gamma \geq 0,\ f \leq 0,\ \gamma f = 0"))
        rates = [_name(v, dot=True) for v in law.internal if v in law.forces]
        forces = [_name(law.forces[v]) for v in law.internal if v in law.forces]
        rows.append(
            Row(
                "force form",
                f"({', '.join(r for r, _ in rates)}) in dphi_star({', '.join(f for f, _ in forces)}), phi_star = 0 if f <= 0, "
                "else +oo: the normal cone, also at a vertex, where f has no gradient",
                rf"({', '.join(r for _, r in rates)}) \in \partial\varphi^{{*}}({', '.join(f for _, f in forces)}),"
                rf"\ \varphi^{{*}} = I_{{\{{f \leq 0\}}}}",
            )
        )
        rows.append(
            Row(
                "rate form",
                f"({', '.join(f for f, _ in forces)}) in dphi, phi = sup over f <= 0 of the products of forces and "
                f"({', '.join(r for r, _ in rates)})",
                rf"({', '.join(f for _, f in forces)}) \in \partial\varphi,\ \varphi = \sup_{{f \leq 0}} \sum A_m \cdot \dot\alpha_m",
            )
        )
    return rows
