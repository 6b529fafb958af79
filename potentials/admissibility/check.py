"""Admissibility of a law: proofs by rules, then by exact programs, then a search for a counter-example.

The law is that of a generalised standard material. If ψ is convex in (ε, α) and concave in T, and φ* is convex, closed, non-negative
and zero at zero, then so is φ, and the dissipation φ + φ* of every process is not negative (Halphen and Nguyen 1975). A convex function
that is finite everywhere is continuous, so that it and its level sets {f ≤ 0} are closed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...errors import InputError
from ..law import Law
from .conditions import Condition, as_conditions, exact_values, holds, softens
from .convexity import Proof
from .counterexample import CounterExample
from .draws import parameter_draws
from .kind import cannot_evolve, kind_of
from .questions import Question, questions_of
from .report import AdmissibilityReport
from .search import Budget

__all__ = ["check"]

SEED = 20080215


def check(law: Law, values: Mapping[str, Any] | None = None, *, seconds: float = 4.0) -> AdmissibilityReport:
    """Report for all parameters, or for the given `values` of some or all of them. `seconds` bounds the search for counter-examples.

    Raises `InputError` for a name that is no parameter and for a value that is no finite number.
    """
    return _Check(law, _numbers(law, values or {}), seconds).report()


def _numbers(law: Law, values: Mapping[str, Any]) -> dict[Any, float]:
    import math

    known = {p.name: p for p in law.parameters}
    found = {}
    for name, value in values.items():
        if name not in known:
            raise InputError(f"law '{law.name}' has no parameter '{name}'; it has: {', '.join(known) or 'none'}")
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise InputError(
                f"law '{law.name}': parameter '{name}' must be a number, not {type(value).__name__}"
            ) from None
        if not math.isfinite(number):
            raise InputError(f"law '{law.name}': parameter '{name}' is {number}; it must be finite")
        found[known[name]] = number
    return found


class _Check:
    def __init__(self, law: Law, values: dict[Any, float], seconds: float) -> None:
        self.law, self.values, self.seconds = law, values, seconds
        self.conditions: list[Condition] = []
        self.reasons: list[str] = []
        self.softening: list[str] = []
        self.example: CounterExample | None = None
        self.answers: dict[str, list[bool | None]] = {"psi": [], "phi": []}

    def report(self) -> AdmissibilityReport:
        law = self.law
        outside = [
            f"{p.name} = {v:g} lies outside [{p.lower:g}, {p.upper:g}]"
            for p, v in self.values.items()
            if not p.lower <= v <= p.upper
        ]
        self.questions = questions_of(law)
        for question in self.questions:
            answer = self._answer(question)
            self.answers["psi" if question.potential.startswith("psi") else "phi"].append(answer)
        kind, notes = kind_of(law)
        answers = [a for found in self.answers.values() for a in found]
        admissible = False if False in answers else (None if None in answers or outside else True)
        opposed = next(
            ((c, d) for c in self.conditions for d in self.conditions if c.expression == -d.expression), None
        )
        if admissible and opposed is not None:
            admissible = None
            self.reasons.append(f"undecided: {opposed[0]} and {opposed[1]} leave no room")
        self.reasons += [f"outside the declaration: {text}" for text in outside]
        dissipative = None if None in self.answers["phi"] else False not in self.answers["phi"]
        self._closing(dissipative, notes)
        return AdmissibilityReport(
            law.name,
            admissible,
            tuple(dict.fromkeys(self.conditions)) if admissible is not False else (),
            tuple(self.reasons),
            self.example,
            kind,
            not law.frozen,
            tuple(v.name for v in law.frozen),
            cannot_evolve(law),
            tuple(dict.fromkeys(self.softening)),
            dissipative,
            {p.name: p for p in law.parameters},
        )

    def _closing(self, dissipative: bool | None, notes: list[str]) -> None:
        potential = self.law.phi if self.law.phi is not None else self.law.phi_star
        if potential is None:
            self.reasons.append("dissipation: none, the law is elastic")
        elif dissipative:
            self.reasons.append(
                "dissipation: phi + phi_star >= 0 follows, as phi_star is convex, closed, not negative and zero at zero"
            )
        elif dissipative is None:
            self.reasons.append("dissipation: not decided, as the properties of phi_star are not")
        else:
            self.reasons.append("dissipation: that it is not negative does not follow")
        self.reasons += notes

    # -- one question ------------------------------------------------------------------------------------------------------------

    def _answer(self, question: Question) -> bool | None:
        head = f"{question.potential}: {question.what}"
        proof = question.prove({})
        failed: list[Condition] = []
        if proof is not None:
            failed = self._decided(question, proof)
            if not failed:
                self._proved(question, head, proof)
                return True
            for condition in failed:
                self._soften(condition)
        exact = exact_values(self.values, self.law._expressions())
        infinite = next((c for c in failed if _is_nan(c.value(self.values))), None)
        if infinite is not None:
            self.reasons.append(f"{head}: refuted, {infinite} is not finite for the values given")
            return False
        if exact:
            again = question.prove(exact)
            if again is not None and not self._decided(question, again):
                self._proved(question, f"{head} for the values given", again)
                return True
        return self._refuted(question, head, failed)

    def _decided(self, question: Question, proof: Proof) -> list[Condition]:
        """Conditions of the proof that the values break; the undecided ones are listed."""
        return [c for c in as_conditions(proof.needs, question.potential) if holds(c, self.values) is False]

    def _proved(self, question: Question, head: str, proof: Proof) -> None:
        wanted = as_conditions(proof.needs, question.potential)
        self.reasons += [f"{question.potential}: {step}" for step in proof.steps]
        self.reasons += [f"{question.potential}: defined where {d} > 0" for d in dict.fromkeys(proof.domain)]
        kept = [c for c in wanted if holds(c, self.values) is None]
        self.conditions += kept
        self.reasons.append(f"{head}: proved" + (f" if {', '.join(kept)}" if kept else ""))

    def _soften(self, condition: Condition) -> None:
        found = condition.value(self.values)
        if not softens(condition, self.law.observable.name) or found is None:
            return
        names = [s.name for s in condition.symbols]
        self.softening += names
        shown = ", ".join(f"{s.name} = {self.values[s]:g}" for s in condition.symbols)
        self.reasons.append(
            f"softening: {shown} gives {' and '.join(condition.variables)} a negative hardening modulus ({condition} fails)"
        )

    def _refuted(self, question: Question, head: str, failed: list[Condition]) -> bool | None:
        import numpy as np

        rng = np.random.default_rng(SEED)
        found: list[CounterExample | None] = []
        wishes = [wish for q in self.questions for wish in q.wishes()]
        draws = parameter_draws(self.law, self.values, wishes, rng)
        free = {p.name for p in self.law.parameters if p not in self.values}
        for draw in draws:
            found.append(question.refute(draw, rng, Budget(self.seconds / len(draws))))
            if found[-1] is None or not set(found[-1].parameters) & free:
                break  # a counter-example without free parameters is one for all of them
        for condition in failed:
            value = condition.value(self.values)
            self.reasons.append(
                f"{question.potential}: {condition} fails" + ("" if value is None else f": {value[0]:g}")
            )
        if None not in found:
            first = self.example is None
            self.example = self.example or found[0]
            tried = f"; so it is for all {len(found)} sets of parameters tried" if len(found) > 1 else ""
            self.reasons.append(f"{head}: refuted" + (" by the counter-example" if first else f", {found[0]}") + tried)
            self._name_softening(question)
            return False
        first = next((f for f in found if f is not None), None)
        if first is not None:
            self.example = self.example or first
            self.reasons.append(
                f"{head}: undecided; it fails for some parameters ({first}), for others no rule and no counter-example"
            )
        else:
            self.reasons.append(f"{head}: undecided; no rule proves it and a search found no counter-example")
        return None

    def _name_softening(self, question: Question) -> None:
        """Without values: which parameters enter the negative modulus of internal variables alone."""
        if question.potential != "psi" or self.example is None or self.softening or self.law.psi is None:
            return
        if len(self.example.points) != 3:
            return
        first, second = self.example.points[:2]
        moved = [n for n in first if first[n] != second[n]]
        internal = {v.name: v for v in self.law.internal}
        if moved and all(n in internal for n in moved):
            names = sorted(
                p.name
                for p in self.law.parameters
                if any(t.has(p) and any(t.has(internal[n]) for n in moved) for t in _terms(self.law.psi))
            )
            self.softening += names
            self.reasons.append(
                f"softening: psi bends downwards in {', '.join(moved)} alone"
                + (f"; the modulus is made of {', '.join(names)}" if names else "")
            )


def _is_nan(found: tuple[float, float] | None) -> bool:
    return found is not None and found[0] != found[0]


def _terms(expression: Any) -> Any:
    return expression.args if expression.is_Add else (expression,)
