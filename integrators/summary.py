"""What a step, a path and a comparison say of themselves: counts, shapes and ranges, as text and as rows of a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import Status
from ..notebook import array_cells, html_table, text_table

__all__ = ["HEADS", "array_rows", "as_html", "as_text", "status_words", "step_words"]

HEADS = ("", "unit", "shape", "range")
UNITS = {
    "eps": "-",
    "sig": "Pa",
    "strain": "-",
    "stress": "Pa",
    "psi": "J/m³",
    "dissipation": "J/m³",
    "gap": "J/m³",
    "entropy": "J/(m³ K)",
    "flux": "W/(m² K)",
    "temperature": "K",
    "iterations": "systems",
}


def status_words(status: Any) -> str:
    """How many points ended how.

    >>> status_words(np.array([0, 0, 1]))
    '2 converged, 1 iteration limit'
    """
    codes, counts = np.unique(np.asarray(status), return_counts=True)
    known = {int(s): s.name.lower().replace("_", " ") for s in Status}
    return ", ".join(f"{n} {known.get(int(c), f'status {int(c)}')}" for c, n in zip(codes, counts, strict=True))


def array_rows(
    arrays: Mapping[str, Any], state: Mapping[str, Any], units: Mapping[str, str] | None = None
) -> list[tuple[str, ...]]:
    """Rows under `HEADS`; None is left out, the unit of an internal variable is not known here."""
    table = {**UNITS, **(units or {})}
    rows = [array_cells(name, table.get(name, ""), value) for name, value in arrays.items() if value is not None]
    return rows + [array_cells(f"state['{name}']", "", value) for name, value in state.items()]


def as_text(title: str, rows: list[tuple[str, ...]]) -> str:
    """For a terminal."""
    return text_table(title, rows)


def as_html(title: str, rows: list[tuple[str, ...]], heads: tuple[str, ...] = HEADS) -> str:
    """For a notebook."""
    return html_table(title, heads, rows)


def step_words(update: Any) -> str:
    """What a step is: "step of 'sand', 3d, driven by the strain, solver 'reduced' (why)"."""
    by = getattr(update, "formulation", "strain")
    dimension = getattr(getattr(update, "dimension", None), "name", "3d")
    settings = [
        f"{word} {value}" for word in ("precision", "threads") if (value := getattr(update, word, None)) is not None
    ]
    why = getattr(update, "why", "")
    return f"step of '{update.law.name}', {dimension}, driven by the {by}, " + ", ".join(
        [f"solver '{update.solver}'" + (f" ({why})" if why else ""), *settings]
    )
