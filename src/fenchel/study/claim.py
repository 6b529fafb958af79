"""A claim of the study, what was found about it, and a part of the study that says so."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from ..campaign import Task
from ..errors import FenchelError
from .sizes import Size

__all__ = ["FAIL", "PASS", "UNDECIDED", "Claim", "Part", "Picture", "Verdict", "decided", "judged", "taken", "unjudged"]

Outcome = Literal["pass", "fail", "undecided"]
PASS: Outcome = "pass"
FAIL: Outcome = "fail"
UNDECIDED: Outcome = "undecided"


@dataclass(frozen=True)
class Claim:
    """Number, kind (T theorem, N a number is given, Q qualitative, A depends on an assumption), what is claimed, and when it passes."""

    number: int
    kind: str
    text: str
    criterion: str


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What was found about a claim: one sentence with the figures, the headline number with its interval, all numbers, what they depend on.

    `needed` says what would decide an undecided claim.
    """

    claim: int
    outcome: Outcome
    sentence: str
    value: float | None = None
    unit: str = "1"
    low: float | None = None
    high: float | None = None
    numbers: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    needed: str = ""


@dataclass(frozen=True)
class Picture:
    """A figure of the report; `study` tells what the figure of the study that stands beside it shows ("" if none does)."""

    key: str
    caption: str
    draw: Callable[[], Any]  # a matplotlib figure
    study: str = ""
    kind: str = "svg"


@dataclass(frozen=True)
class Part:
    """A part of the study: its claims, the tasks that they need, and what follows from the results (by name of the task).

    `tasks(size, folder, wanted)` leaves out what none of the `wanted` claims needs; `judge` gives one verdict for every wanted claim.
    A task that failed has its error (`FenchelError`) as its result.
    """

    letter: str
    title: str
    claims: Sequence[Claim]
    tasks: Callable[[Size, Path, frozenset[int]], list[Task]]
    judge: Callable[[Size, Path, Mapping[str, Any], frozenset[int]], list[Verdict]]
    pictures: Callable[[Size, Path, Mapping[str, Any]], list[Picture]] = lambda _size, _folder, _results: []

    @property
    def numbers(self) -> frozenset[int]:
        """Those of its claims."""
        return frozenset(claim.number for claim in self.claims)


def decided(condition: bool) -> Outcome:
    """Pass or fail."""
    return PASS if condition else FAIL


def taken(results: Mapping[str, Any], name: str) -> Any:
    """What a task left; the error of one that failed is raised."""
    found = results[name]
    if isinstance(found, FenchelError):
        raise found
    return found


def judged(
    claims: Sequence[Claim],
    wanted: frozenset[int],
    make: Callable[[int], Verdict],
    *,
    needed: str = "a run that converges",
) -> list[Verdict]:
    """`make(number)` for every wanted claim; where that raises, the verdict of `unjudged`."""
    out: list[Verdict] = []
    for claim in claims:
        if claim.number not in wanted:
            continue
        try:
            out.append(make(claim.number))
        except FenchelError as problem:
            out += unjudged([claim], wanted, problem, needed=needed)
    return out


def unjudged(
    claims: Sequence[Claim], wanted: frozenset[int], problem: FenchelError, *, needed: str = "a run that converges"
) -> list[Verdict]:
    """Verdicts of the wanted claims whose runs failed: a theorem fails, any other claim is undecided and needs a run that does not."""
    return [
        Verdict(claim=claim.number, outcome=FAIL, sentence=str(problem))
        if "T" in claim.kind
        else Verdict(claim=claim.number, outcome=UNDECIDED, sentence=str(problem), needed=needed)
        for claim in claims
        if claim.number in wanted
    ]
