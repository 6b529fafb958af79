"""A theorem as a check: one computation that returns numbers, and what these must be below or above for the theorem to hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..campaign import Computation, Task
from ..errors import FenchelError
from .claim import FAIL, Claim, Part, Picture, Verdict, decided
from .sizes import Size

__all__ = ["Check", "part_of"]


@dataclass(frozen=True, kw_only=True)
class Check:
    """`function(**arguments(size))` returns a table "numbers", on which `below` (≤), `above` (≥) and the words of `sentence` draw.

    `headline` names the number that stands for the claim, `held` says what is the same at all sizes.
    """

    claim: Claim
    name: str
    function: Callable[..., dict[str, Any]]
    arguments: Callable[[Size], Mapping[str, Any]]
    below: Mapping[str, float]
    sentence: str
    headline: str
    above: Mapping[str, float] = field(default_factory=dict)
    held: Mapping[str, Any] = field(default_factory=dict)
    cost: float = 1.0

    def task(self, size: Size, folder: Path) -> Computation:
        """The computation at a size."""
        return Computation(self.name, self.function, folder, self.arguments(size), cost=self.cost)

    def verdict(self, size: Size, result: Any) -> Verdict:
        """Pass if every bound is kept; a number that is none (NaN) keeps no bound."""
        settings = {
            **self.held,
            **self.arguments(size),
            **{f"bound of {k}": v for k, v in (*self.below.items(), *self.above.items())},
        }
        if isinstance(result, FenchelError):
            return Verdict(
                claim=self.claim.number, outcome=FAIL, sentence=f"The check stopped: {result}", settings=settings
            )
        numbers = dict(result["numbers"])
        broken = [f"{k} = {numbers[k]:.2g}, not at most {v:g}" for k, v in self.below.items() if not numbers[k] <= v]
        broken += [f"{k} = {numbers[k]:.2g}, not at least {v:g}" for k, v in self.above.items() if not numbers[k] >= v]
        sentence = self.sentence.format(**{_word(k): v for k, v in numbers.items()})
        return Verdict(
            claim=self.claim.number,
            outcome=decided(not broken),
            sentence=f"Broken: {'; '.join(broken)}." if broken else sentence,
            value=float(numbers[self.headline]),
            numbers=numbers,
            settings=settings,
        )


def _word(name: str) -> str:
    """The name of a number as `sentence` writes it."""
    return name.translate({ord(" "): "_", ord("."): "_", ord(","): None})


def part_of(
    letter: str,
    title: str,
    checks: Sequence[Check],
    pictures: Callable[[Size, Path, Mapping[str, Any]], list[Picture]] = lambda _size, _folder, _results: [],
) -> Part:
    """A part whose claims are all theorems, one computation for each."""

    def tasks(size: Size, folder: Path, wanted: frozenset[int]) -> list[Task]:
        return [check.task(size, folder) for check in checks if check.claim.number in wanted]

    def judge(size: Size, _folder: Path, results: Mapping[str, Any], wanted: frozenset[int]) -> list[Verdict]:
        return [check.verdict(size, results[check.name]) for check in checks if check.claim.number in wanted]

    return Part(letter, title, tuple(check.claim for check in checks), tasks, judge, pictures)
