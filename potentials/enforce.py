"""What the answer means for whoever compiles and uses a law: a refuted law is refused, values that break a condition are refused.

The proof takes a fraction of a second, so that its outcome is kept on disk as a small module under the hash of the declaration and of the
sources that proved it; what is kept is what `check` says, nothing is decided twice.
"""

from __future__ import annotations

import functools
import importlib.util
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ..cache import cache_folder, content_hash, source_hash
from ..errors import DeclarationError, InputError, StorageError
from .atoms import ATOMS

if TYPE_CHECKING:
    from .law import Law

__all__ = ["ROUNDING", "enforce", "refuse"]

SEARCH_SECONDS = 1.0
ROUNDING = 1e-10
"""Share of its largest term by which a condition may fail: exactly singular moduli pass in spite of rounding."""


def refuse(law: Law) -> None:
    """`DeclarationError` with the reason and the counter-example if the law is refuted for all parameters."""
    reason = _record(law).REFUSED
    if reason:
        raise DeclarationError(
            f"law '{law.name}' is not admissible: {reason}; declare it otherwise, or insist: compile(insist=True)"
        )


def enforce(law: Law, values: Mapping[str, float]) -> None:
    """`InputError` that names the first condition on the parameters that the values break."""
    record = _record(law)
    known = _accepted(law)
    key = tuple(values.values())
    if key in known:
        return
    failed = _first_failure(record, key)
    if failed is not None and failed[-1] != failed[-1]:
        failed = (failed[0], _culprits(record, values) or failed[1], *failed[2:])
    if failed is not None:
        from .admissibility import check

        about, names, variables, text, value = failed
        # the conditions suffice; where one fails, another rule may hold for these values
        if value != value or check(law, values, seconds=SEARCH_SECONDS).admissible is not True:
            raise InputError(f"law '{law.name}': {_reason(law, about, names, variables, text, value, values)}")
    if len(known) > 256:
        known.clear()
    known.add(key)


def _first_failure(record: ModuleType, values: tuple[float, ...]) -> Any:
    try:
        numbers = record.conditions_(values)
    except (ZeroDivisionError, OverflowError, ValueError, TypeError):
        numbers = ((float("nan"), 1.0),) * len(record.CONDITIONS)
    for (about, names, variables, text, strict), (value, size) in zip(record.CONDITIONS, numbers, strict=True):
        if not abs(value) < float("inf"):
            return about, names, variables, text, float("nan")
        if not (value > 0.0 if strict else value >= -ROUNDING * size):
            return about, names, variables, text, value
    return None


def _culprits(record: ModuleType, values: Mapping[str, float]) -> str:
    """Parameters of which a change of any one makes every condition a number."""
    found = []
    for name, value in values.items():
        moved = {**values, name: value + 1e-3 * (abs(value) or 1.0) * (-1.0 if value > 0.0 else 1.0)}
        failed = _first_failure(record, tuple(moved.values()))
        if failed is None or failed[-1] == failed[-1]:
            found.append(name)
    return " ".join(found)


def _reason(
    law: Law, about: str, names: str, variables: str, text: str, value: float, values: Mapping[str, float]
) -> str:
    involved = names.split()
    shown = ", ".join(f"{n} = {values[n]:g}" for n in involved)
    if value != value:
        return f"{shown} {'makes' if len(involved) == 1 else 'make'} a modulus infinite; Poisson ratios lie strictly between -1 and 1/2"
    potential, _, what = about.partition(" ")
    moved = variables.split()
    if what == "norm":
        return f"{shown} gives a norm in {potential} a negative weight; f would not be convex"
    if what == "zero":
        return (
            f"{shown} puts zero force outside the elastic domain of {potential}: {text} fails, "
            f"the limit at zero is {value:g}, negative"
        )
    if what == "modulus" and potential == "psi":
        if law.observable.name in moved or not moved:
            return f"{shown} give a negative stiffness; psi would not be convex"
        if len(moved) > 1:
            return f"{shown} make psi non-convex in {', '.join(moved)} together; softening is not modelled"
        return f"{shown} gives '{moved[0]}' a negative modulus; psi would not be convex: softening is not modelled"
    consequence = "not be concave where it has to be" if potential == "psi_star" else "not be convex"
    return f"{shown} breaks the condition {text}; {potential} would {consequence}"


# -- the record -------------------------------------------------------------------------------------------------------------------


@functools.lru_cache(maxsize=256)
def _accepted(law: Law) -> set[tuple[float, ...]]:
    return set()


@functools.lru_cache(maxsize=256)
def _record(law: Law) -> ModuleType:
    """Record of the law, from memory, else from disk, else written now."""
    bounds = "\n".join(f"{p.name} {p.lower!r} {p.upper!r} {p.default!r}" for p in law.parameters)
    key = content_hash(law.text, bounds, source_hash("potentials"), *_foreign_atoms(law))
    name = f"fenchel_admissibility_{law.name}_{key}"
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / "laws" / f"{name}.py"
    if not path.is_file():
        _write(path, record_source(law))
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def record_source(law: Law) -> str:
    """Text of the record: the refusal or "", the conditions with what they are about, and their numbers with the size of their terms."""
    from .admissibility import check
    from .printer import number_code

    report = check(law, {}, seconds=SEARCH_SECONDS)
    refused = ""
    if report.admissible is False:
        refused = str(report.counterexample or next(r for r in reversed(report.reasons) if "refuted" in r))
    conditions = [c for c in report.conditions if not c.on_state]
    rows, numbers = [], []
    for condition in conditions:
        rows.append(repr(_row(condition)))
        parts = [condition.expression] if not condition.expression.is_Add else list(condition.expression.args)
        size = " + ".join(f"abs({number_code(p)})" for p in parts)
        numbers.append(f"({number_code(condition.expression)}, {size})")
    unpack = [f"    {p.name} = values_[{i}]" for i, p in enumerate(law.parameters)]
    return "\n".join(
        [
            f'"""Conditions on the parameters of the law `{law.name}`, written by fenchel."""',
            "",
            "import math",
            "",
            f"REFUSED = {refused!r}",
            f"CONDITIONS = ({''.join(f'{row}, ' for row in rows)})",
            "",
            "",
            "def conditions_(values_):",
            '    """(value, size of its terms) of every condition."""',
            *unpack,
            f"    return ({''.join(f'{n}, ' for n in numbers)})",
            "",
        ]
    )


def _row(condition: Any) -> tuple[str, str, str, str, bool]:
    return (
        f"{condition.potential} {condition.about}",
        " ".join(s.name for s in condition.symbols),
        " ".join(condition.variables),
        str(condition),
        condition.strict,
    )


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(temporary, path)
    except OSError as error:
        raise StorageError(
            f"cannot write generated code to {path.parent}: {error.strerror}; set FENCHEL_CACHE to another folder"
        ) from error


def _foreign_atoms(law: Law) -> list[bytes]:
    """Sources of the atoms of the user that the law is written in: an edit of one must not leave an old proof."""
    found: set[str] = set()
    for expression in law._expressions():
        for node in expression.atoms(*ATOMS):
            place = type(ATOMS[type(node)]).__module__
            if place.partition(".")[0] != __name__.partition(".")[0]:
                found.add(getattr(sys.modules.get(place), "__file__", None) or "")
    return [Path(file).read_bytes() if file else os.urandom(16) for file in sorted(found)]
