"""The study, claim by claim: runs what the wanted claims need, judges, writes `report.html` and `claims.json`.

What was run before in the folder is taken up. A run that fails does not stop the others: its claims say so.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .. import __version__
from ..campaign import Task, run_campaign
from ..dem.storage import replace_file
from ..errors import FenchelError, InputError
from ..identify.jsonable import jsonable
from .claim import FAIL, Claim, Part, Verdict
from .headline import Headline, headline_numbers, headline_tasks, headlines
from .notes import NOTES
from .parts import all_parts
from .sizes import Size, size_named

__all__ = ["Reproduction", "reproduce", "wanted_claims"]

EXTRAS = ("headlines", "choice")


@dataclass(frozen=True)
class Reproduction:
    """What was found, in the order of the claims."""

    size: Size
    parts: Sequence[Part]
    verdicts: Mapping[int, Verdict]
    headlines: Sequence[Headline]
    choice: Mapping[str, Any] | None  # summary of the costs to identify with; None: not asked for
    results: Mapping[str, Any]
    folder: Path

    @property
    def claims(self) -> dict[int, Claim]:
        """Those that were wanted."""
        return {c.number: c for part in self.parts for c in part.claims if c.number in self.verdicts}

    @property
    def theorems_hold(self) -> bool:
        """Whether every wanted claim of kind T passes."""
        return all(v.outcome == "pass" for n, v in self.verdicts.items() if "T" in self.claims[n].kind)

    def count(self, outcome: str) -> int:
        """How many claims have that outcome."""
        return sum(v.outcome == outcome for v in self.verdicts.values())


def wanted_claims(words: Sequence[str]) -> tuple[frozenset[int], frozenset[str]]:
    """Claims and extras named by numbers, ranges ("4-16"), letters of parts, "headlines" and "choice"; nothing means all."""
    parts = {part.letter: part.numbers for part in all_parts()}
    known = frozenset().union(*parts.values())
    if not words:
        return known, frozenset(EXTRAS)
    claims: set[int] = set()
    extras: set[str] = set()
    for word in words:
        ends = re.fullmatch(r"(\d+)(?:-(\d+))?", word)
        if ends:
            low, high = int(ends[1]), int(ends[2] or ends[1])
            found = {n for n in known if low <= n <= high}
            if not found:
                raise InputError(f"claim {word}: there are claims {min(known)} to {max(known)} (72 to 77 are notes)")
            claims |= found
        elif word.upper() in parts:
            claims |= parts[word.upper()]
        elif word.lower() in EXTRAS:
            extras.add(word.lower())
        else:
            raise InputError(
                f"claim {word!r}: give numbers, ranges like 4-16, parts {', '.join(parts)}, or {' and '.join(EXTRAS)}"
            )
    return frozenset(claims), frozenset(extras)


def _tasks(size: Size, folder: Path, claims: frozenset[int], extras: frozenset[str]) -> list[Task]:
    """Everything that is needed, each task once."""
    from . import formulation_choice
    from .identification_runs import choice_task, identify_tasks

    every: list[Task] = [task for part in all_parts() for task in part.tasks(size, folder, claims)]
    if "headlines" in extras:
        every += headline_tasks(size, folder)
    if "choice" in extras:
        every += [*formulation_choice.tasks(size, folder), *identify_tasks(size, folder), choice_task(size, folder)]
    table: dict[str, Task] = {}
    for task in every:
        if table.setdefault(task.name, task) != task:
            raise FenchelError(f"{task.name}: two parts mean different runs by this name")
    return list(table.values())


def _settle(folder: Path, size: Size) -> None:
    """Refuse a folder of another size, or one that no reproduction has begun."""
    mark = folder / "reproduction.json"
    text = json.dumps({"size": size.name, "fenchel": __version__}, sort_keys=True) + "\n"
    if mark.exists():
        before = mark.read_text(encoding="utf-8")
        if before != text:
            raise InputError(f"{folder}: holds a reproduction of {before.strip()}; choose another folder")
        return
    for name in ("report.html", "claims.json", "runs"):
        if (folder / name).exists():
            raise InputError(f"{folder / name}: is there already and not from a reproduction; choose another folder")
    replace_file(mark, text.encode())


def reproduce(
    words: Sequence[str] = (),
    size: str = "small",
    directory: Path | str = "reproduction",
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    show: bool = True,
) -> Reproduction:
    """Run, judge and report the wanted claims at a size ("small", "medium", "paper"); finished runs in `directory` are taken up.

    Raises `InputError` for unknown claims or sizes and for a folder of something else, `StorageError` when a file cannot be written.
    """
    from . import formulation_choice
    from .reproduce_report import write_reproduction

    chosen = size_named(size)
    claims, extras = wanted_claims(words)
    directory = Path(directory)
    folder = directory / "runs"
    _settle(directory, chosen)
    results = run_campaign(
        _tasks(chosen, folder, claims, extras), folder, jobs=jobs, scheduler=scheduler, show=show, keep_going=True,
        label="whole study",
    )  # fmt: skip
    parts = [part for part in all_parts() if part.numbers & claims]
    verdicts: dict[int, Verdict] = {}
    for part in parts:
        for verdict in part.judge(chosen, folder, results, claims):
            verdicts[verdict.claim] = verdict
    kinds = {c.number: c.kind for part in parts for c in part.claims}
    for number in claims - set(verdicts):
        verdicts[number] = Verdict(claim=number, outcome=FAIL, sentence="No verdict: a bug of fenchel.")
    # nan means that there is no such number
    verdicts = {n: _plain(verdicts[n]) for n in sorted(verdicts)}
    choice = formulation_choice.summary(results) if "choice" in extras else None
    found = Reproduction(
        chosen, parts, verdicts, headlines(chosen, folder, results) if "headlines" in extras else [], choice, results, folder,
    )  # fmt: skip
    assert set(kinds) >= set(verdicts)
    replace_file(directory / "claims.json", claims_json(found).encode())
    write_reproduction(found, directory)
    return found


def _plain(verdict: Verdict) -> Verdict:
    def number(x: float | None) -> float | None:
        return None if x is None or x != x else float(x)

    return replace(verdict, value=number(verdict.value), low=number(verdict.low), high=number(verdict.high))


def claims_json(found: Reproduction) -> str:
    """The same numbers as the report, as JSON; equal runs give equal text."""
    claims = found.claims
    parts = {c.number: part for part in found.parts for c in part.claims}
    table = [
        {
            "claim": n, "part": parts[n].letter, "kind": claims[n].kind, "text": claims[n].text, "criterion": claims[n].criterion,
            "outcome": v.outcome, "sentence": v.sentence, "value": v.value, "unit": v.unit, "low": v.low, "high": v.high,
            "needed": v.needed, "numbers": v.numbers, "settings": v.settings,
        }
        for n, v in found.verdicts.items()
    ]  # fmt: skip
    whole = {
        "study": "R. Laniel, P. Alart, S. Pagano, Homogenization attempt of a wire-reinforced geomaterial (LMGC, Montpellier, c. 2008)",
        "fenchel": __version__,
        "size": jsonable(found.size),
        "claims": table,
        "headlines": headline_numbers(list(found.headlines)),
        "choice": found.choice,
        "notes": NOTES,
    }
    return json.dumps(jsonable(whole, arrays=True), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
