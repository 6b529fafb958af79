"""Legendre–Fenchel conjugates F*(y) = sup over x of y·x − F(x): by rule where one exists, else as the supremum that it is.

`partial_conjugate` takes the supremum in one slot and leaves the others as they are: in these F* is concave where F is convex, and the
envelope theorem gives ∂F*/∂α = −∂F/∂α. `total_conjugate` takes it in all slots: x ∈ ∂F*(y) is y ∈ ∂F(x), slot by slot, with the same sign.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from sympy import Expr

from ...errors import DeclarationError
from ..atoms.norm import norm
from ..derivative import partial
from ..evaluate import evaluate
from ..extended import Extended
from ..invariants import Invariant
from ..ranked import Ranked
from ..tensor import Deviator
from .form import MinForm, NoRule, Phase
from .slots import mentions
from .sums import conjugate_form
from .wording import Words, comparison, conditions_of, domain_words, joined, paired, value_words, variables_shown

__all__ = ["Conjugate", "conjugate"]


def conjugate(function: Extended, duals: Mapping[Any, Any]) -> Conjugate:
    """Conjugate of F over the slots that `duals` maps to their dual symbols; a term without a rule leaves the supremum."""
    table = dict(duals)
    try:
        return Conjugate(function, tuple(table), table, conjugate_form(function, table, table))
    except NoRule as reason:
        return Conjugate(function, tuple(table), table, None, str(reason))


@dataclass(frozen=True)
class Conjugate:
    """F* of `function` over `slots`, a function of the symbols `duals[slot]`.

    `form` is the minimum that the rules give (with no unknown left where F* is closed), None where no rule is known; `missing` then
    names the term in the way.
    """

    function: Extended
    slots: tuple[Any, ...]
    duals: dict[Any, Any] = field(hash=False)
    form: MinForm | None
    missing: str = ""

    # -- what is known ---------------------------------------------------------------------------------------------------------

    @property
    def closed(self) -> bool:
        """True if a formula without minimum or supremum is known."""
        return self.form is not None and not self.form.unknowns

    @property
    def expression(self) -> Expr:
        """Value inside the domain; `DeclarationError` if there is no closed form."""
        return self._closed().value

    @property
    def domain(self) -> tuple[Expr, ...]:
        """Expressions that are ≤ 0 where F* is finite (closed form only)."""
        return self._closed().inequalities

    @property
    def equalities(self) -> tuple[Any, ...]:
        """Scalars and tensors that vanish where F* is finite (closed form only)."""
        return self._closed().equalities

    @property
    def rules(self) -> tuple[str, ...]:
        """Names of the rules used."""
        return ("none: " + self.missing,) if self.form is None else self.form.rules

    @property
    def conditions(self) -> tuple[Expr, ...]:
        """Expressions in parameters that have to be positive for the formula to hold."""
        return () if self.form is None else conditions_of(self.form.conditions)

    @property
    def cases(self) -> tuple[Words, ...]:
        """Cases as text and LaTeX, where the formula has some."""
        if self.form is None:
            return ()
        return self.form.cases + tuple(c for p in self.form.phases for c in p.cases)

    @property
    def phases(self) -> tuple[Phase, ...]:
        """Functions of the same slot whose conjugates are combined by infimal convolution; empty for a closed form."""
        return () if self.form is None or not self.form.unknowns else self.form.phases

    def _closed(self) -> MinForm:
        if self.form is None:
            raise DeclarationError(
                f"the conjugate has no closed form: {self.missing}; numerical_conjugate gives its numbers"
            )
        if self.form.unknowns:
            raise DeclarationError(
                f"the conjugate has no closed form, it is {self.words()[0]}; numerical_conjugate gives its numbers"
            )
        return self.form

    @cached_property
    def has_gradient(self) -> bool:
        """True if the value can be differentiated as it stands: no coefficient of a tensor in it depends on a variable."""
        wanted = set(self.duals.values())
        for leaf in self._closed().value.atoms(Invariant):
            for quantity in leaf.args:
                if isinstance(quantity, Ranked) and any(mentions(c, wanted) for c in quantity.terms().values()):
                    return False
        return True

    def extended(self) -> Extended:
        """F* as a finite part and the indicator of its domain; an equality e = 0 enters as e ≤ 0, −e ≤ 0, or ‖e‖ ≤ 0."""
        form = self._closed()
        surfaces = list(form.inequalities)
        for e in form.equalities:
            surfaces += [norm(e)] if isinstance(e, Ranked) else [e, -e]
        return Extended(form.value, tuple(surfaces))

    # -- numbers ---------------------------------------------------------------------------------------------------------------

    def value(self, values: Mapping[Any, Any], *, rounding: float = 1e-9) -> Any:
        """F* at arrays by symbol or by name: duals and data (n,), (n, 3), (n, 6) Mandel, parameters; +∞ outside the domain.

        An inequality that is violated by less than `rounding` times the size of its terms counts as met.
        """
        import numpy as np

        table = self._table(values)
        if not self.closed:
            from .numerical import conjugate_values

            return conjugate_values(self, table)
        form = self._closed()
        found = np.asarray(evaluate(form.value, table), dtype=float)
        outside: Any = np.zeros(found.shape, dtype=bool)
        for f in form.inequalities:
            outside = outside | (evaluate(f, table) > rounding * _size(f, table))
        for e in form.equalities:
            misfit = evaluate(e, table)
            misfit = np.sqrt((misfit * misfit).sum(axis=-1)) if isinstance(e, Ranked) else np.abs(misfit)
            outside = outside | (misfit > rounding * _size(e, table))
        return np.where(outside, np.inf, found)[()]

    def gradient(self, values: Mapping[Any, Any]) -> dict[Any, Any]:
        """An element of ∂F* by slot, at points of the domain: the argument of the supremum."""
        table = self._table(values)
        if self.closed and self.has_gradient:
            return {slot: evaluate(partial(self.expression, dual), table) for slot, dual in self.duals.items()}
        from .numerical import conjugate_arguments

        return conjugate_arguments(self, table)

    def _table(self, values: Mapping[Any, Any]) -> dict[Any, Any]:
        names: dict[str, Any] = {}
        for thing in (self.function.finite, *self.function.surfaces, *self.duals.values()):
            for symbol in (*thing.free_symbols, *thing.atoms(Ranked), thing):
                name = getattr(symbol, "name", None)
                if isinstance(name, str):
                    names.setdefault(name, symbol)
        for dual in self.duals.values():
            names[str(getattr(dual, "name", dual))] = dual
        found = {}
        for key, value in values.items():
            symbol = names.get(key) if isinstance(key, str) else key
            if symbol is not None:
                found[symbol] = value
        return found

    # -- words -----------------------------------------------------------------------------------------------------------------

    def words(self, name: Words = ("", "")) -> Words:
        """The formula as text and LaTeX, after `name` = where a name is given."""
        body = self._words()
        if not name[0]:
            return body
        return f"{name[0]} = {body[0]}", f"{name[1]} = {body[1]}"

    def _words(self) -> Words:
        if self.form is None:
            return supremum_words(self.function, self.duals)
        form = self.form
        value, definitions = value_words(form.value)
        domain = domain_words(form.inequalities, form.equalities)
        if form.unknowns:
            over = joined([variables_shown(form.unknowns)])
            constraints = joined(domain)
            where = (f" with {constraints[0]}", rf":\ {constraints[1]}") if domain else ("", "")
            text = f"min over {over[0]}{where[0]} of {{{value[0]}}}"
            tex = rf"\min_{{{over[1]}}}\left\{{{value[1]}{where[1]}\right\}}"
        else:
            conditions = joined(domain)
            text = f"{value[0]} if {conditions[0]}, else +oo" if domain else value[0]
            tex = rf"{value[1]} \quad\text{{if }} {conditions[1]},\ \text{{else }} +\infty" if domain else value[1]
        if definitions:
            also = joined(definitions)
            text, tex = f"{text}, with {also[0]}", rf"{tex},\quad {also[1]}"
        return text, tex

    def text(self) -> str:
        """Formula, cases, conditions and rules, one per line."""
        lines = [self._words()[0]]
        lines += [f"case: {t}" for t, _ in self.cases]
        if self.conditions:
            lines.append("valid for: " + ", ".join(f"{c} > 0" for c in self.conditions))
        return "\n".join([*lines, *(f"rule: {r}" for r in self.rules)])

    def latex(self) -> str:
        """Formula in LaTeX."""
        return self._words()[1]

    __str__ = text

    def _repr_latex_(self) -> str:
        return f"$\\displaystyle {self.latex()}$"


def supremum_words(function: Extended, duals: Mapping[Any, Any]) -> Words:
    """sup over x of y·x − F(x)."""
    products = joined((paired(y, x) for x, y in duals.items()), " + ", " + ")
    over = variables_shown(duals)
    finite = Extended(function.finite)
    minus = (f" - ({finite})", rf" - \left({finite.latex()}\right)") if function.finite != 0 else ("", "")
    where = joined(comparison(f, "<=") for f in function.surfaces)
    over_text = over[0] + (f" with {where[0]}" if function.surfaces else "")
    over_tex = over[1] + (rf":\ {where[1]}" if function.surfaces else "")
    return (
        f"sup over {over_text} of {{{products[0]}{minus[0]}}}",
        rf"\sup_{{{over_tex}}}\left\{{{products[1]}{minus[1]}\right\}}",
    )


def _size(thing: Any, table: Mapping[Any, Any]) -> Any:
    """Sum of the sizes of the terms of a residual."""
    import numpy as np

    total: Any = 0.0
    if isinstance(thing, Ranked):
        for atom, c in thing.terms().items():
            part = evaluate(atom.args[0] if isinstance(atom, Deviator) else atom, table)
            total = total + np.abs(evaluate(c, table)) * np.sqrt((part * part).sum(axis=-1))
        return total
    for term in thing.as_ordered_terms():
        total = total + np.abs(evaluate(term, table))
    for leaf in thing.atoms(Invariant):
        for quantity in leaf.args:
            if isinstance(quantity, Ranked):
                part = evaluate(quantity, table)
                total = total + np.sqrt((part * part).sum(axis=-1))
    return total
