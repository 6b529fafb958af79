"""What is said about a law: the answer, its conditions, its reasons in order, and a counter-example with numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .conditions import Condition, holds
from .counterexample import CounterExample

__all__ = ["VERDICTS", "AdmissibilityReport"]

VERDICTS = {True: "proved", False: "refuted", None: "undecided"}


@dataclass(frozen=True)
class AdmissibilityReport:
    """Answer of `law.check`.

    `admissible`: True, proved for all parameters that keep `conditions`; False, refuted, with a `counterexample`; None, undecided.
    Every condition is its own text and has `.expression` (≥ 0), `.symbols`, and `.implied`, true where the declared bounds imply it.
    `reasons` are the steps in order. `kind` says how the law dissipates; `frozen` names the state that makes it semi-implicit,
    `cannot_evolve` the internal variables without a law of evolution, `softening` the parameters that make a variable soften.
    """

    law: str
    admissible: bool | None
    conditions: tuple[Condition, ...]
    reasons: tuple[str, ...]
    counterexample: CounterExample | None = None
    kind: str = ""
    associated: bool = True
    frozen: tuple[str, ...] = ()
    cannot_evolve: tuple[str, ...] = ()
    softening: tuple[str, ...] = ()
    dissipative: bool | None = None
    symbols: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @property
    def verdict(self) -> str:
        """ "proved", "refuted" or "undecided"."""
        return VERDICTS[self.admissible]

    def holds(self, values: Mapping[str, float] | None = None, /, **named: float) -> bool | None:
        """Whether the conditions hold for these values of the parameters; None while one of them lacks a value."""
        given = {**(values or {}), **named}
        table = {self.symbols[name]: float(value) for name, value in given.items() if name in self.symbols}
        found = [holds(c, table) for c in self.conditions]
        return False if False in found else (None if None in found else True)

    def text(self) -> str:
        """Readable report."""
        lines = [f"{self.law}: {self.verdict}" + (" under the conditions:" if self.conditions else "")]
        lines += [f"  {c}{_remark(c)}" for c in self.conditions]
        lines += ["because:", *(f"  {r}" for r in self.reasons)]
        if self.counterexample is not None:
            lines += ["counter-example:", f"  {self.counterexample}"]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Everything as plain data."""
        return {
            "law": self.law,
            "admissible": self.admissible,
            "verdict": self.verdict,
            "conditions": [str(c) for c in self.conditions],
            "condition_details": [
                {
                    "text": str(c),
                    "expression": str(c.expression),
                    "relation": ">" if c.strict else ">=",
                    "of": c.potential,
                    "parameters": [s.name for s in c.symbols],
                    "implied_by_bounds": c.implied,
                    "on_state": list(c.on_state),
                }
                for c in self.conditions
            ],
            "reasons": list(self.reasons),
            "counterexample": None if self.counterexample is None else self.counterexample.as_dict(),
            "kind": self.kind,
            "associated": self.associated,
            "frozen": list(self.frozen),
            "cannot_evolve": list(self.cannot_evolve),
            "softening": list(self.softening),
            "dissipation_inequality": VERDICTS[self.dissipative],
        }

    def json(self) -> str:
        """`as_dict` as JSON."""
        return json.dumps(self.as_dict(), indent=2)

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        under = f" under {len(self.conditions)} conditions" if self.conditions else ""
        return f"<AdmissibilityReport of law '{self.law}': {self.verdict}{under}; print(report) says why>"

    def _repr_markdown_(self) -> str:
        return f"```\n{self.text()}\n```"


def _remark(condition: Condition) -> str:
    if condition.on_state:
        return f"  (on {', '.join(condition.on_state)}, which no parameter fixes)"
    return "  (implied by the declared bounds)" if condition.implied else ""
