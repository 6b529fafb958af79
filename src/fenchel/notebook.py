"""Results as a few lines in a terminal and as a table or a formula in a notebook (the ground floor: nothing of ours is below).

A result that holds arrays is shown by shape, unit and range, never by its numbers.
"""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar

__all__ = ["Summary", "array_cells", "field_cells", "html_table", "math", "math_table", "text_table"]

FEW = 6  # numbers that are listed one by one: a tensor in Mandel components


def array_cells(name: str, unit: str, array: Any) -> tuple[str, str, str, str]:
    """Name, unit, shape and range of an array (what is not finite is counted apart).

    >>> array_cells("stress", "Pa", [[-1.0, 0.0], [2.5e6, float("nan")]])
    ('stress', 'Pa', '2 × 2', '-1 … 2.5e+06, 1 not finite')
    """
    import numpy as np

    values = np.asarray(array, dtype=float)
    shape = " × ".join(str(n) for n in values.shape) or "one number"
    finite = values[np.isfinite(values)]
    if not finite.size:
        return name, unit, shape, "" if not values.size else "not finite"
    low, high = float(finite.min()), float(finite.max())
    spread = f"{low:.6g}" if low == high else f"{low:.6g} … {high:.6g}"
    lost = values.size - finite.size
    return name, unit, shape, spread + (f", {lost} not finite" if lost else "")


def text_table(title: str, rows: Iterable[Sequence[str]]) -> str:
    """A title and rows of cells under one another, the cells of a column flush left.

    >>> print(text_table("3 points", [("stress", "Pa"), ("dissipation", "J/m³")]))
    3 points
      stress       Pa
      dissipation  J/m³
    """
    lines = [tuple(row) for row in rows]
    widths = [max(len(row[k]) for row in lines) for k in range(len(lines[0]))] if lines else []
    body = ["  " + "  ".join(f"{c:<{w}}" for c, w in zip(row, widths, strict=True)).rstrip() for row in lines]
    return "\n".join([title, *body])


def html_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """The same as HTML; every cell is text, not markup.

    >>> html_table("a < b", ("name",), [("x & y",)]).count("&lt;"), "x &amp; y" in html_table("", ("name",), [("x & y",)])
    (1, True)
    """
    caption = f'<caption style="text-align:left;caption-side:top">{html.escape(title)}</caption>' if title else ""
    head = "".join(f'<th style="text-align:left">{html.escape(h)}</th>' for h in heads)
    body = "".join(
        "<tr>" + "".join(f'<td style="text-align:left">{html.escape(str(c))}</td>' for c in row) + "</tr>"
        for row in rows
    )
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def math(lines: Mapping[str, str] | Sequence[tuple[str, str]]) -> str:
    r"""Displayed LaTeX of rows, a word and a formula each, for MathJax.

    >>> math({"free energy": r"\psi = 0"})
    '$$\\begin{array}{ll}\n\\text{free energy} & \\psi = 0\n\\end{array}$$'
    """
    pairs = lines.items() if isinstance(lines, Mapping) else lines
    body = " \\\\\n".join(rf"\text{{{word}}} & {formula}" for word, formula in pairs)
    return "$$\\begin{array}{ll}\n" + body + "\n\\end{array}$$"


def math_table(rows: Iterable[tuple[str, str]]) -> str:
    r"""Rows of a word and a formula as a table in Markdown, every formula by itself: one display of all would be too long for MathJax.

    >>> print(math_table([("elastic domain", r"f = \left\|A\right\| - k \leq 0")]))
    | | |
    |---|---|
    | elastic domain | $\displaystyle f = \left\Vert A\right\Vert  - k \leq 0$ |
    """
    body = [rf"| {word} | $\displaystyle {_without_bars(formula)}$ |" for word, formula in rows]
    return "\n".join(["| | |", "|---|---|", *body])


def _without_bars(formula: str) -> str:
    """LaTeX without the bars that would end a cell, and on one line."""
    return " ".join(formula.replace(r"\|", r"\Vert ").replace("|", r"\vert ").split())


class Summary:
    """Mixin of a dataclass that holds results: it prints as a table of its fields, and is one in a notebook.

    Arrays are shown by shape, unit and range, mappings by their names, sequences by their length; None is left out. Declare such a class
    with `@dataclass(repr=False)`; `UNITS` names the units of its fields, `_title` says in a line what the object is.
    """

    UNITS: ClassVar[Mapping[str, str]] = {}
    HEADS: ClassVar[tuple[str, ...]] = ("", "unit", "shape", "value")

    def _title(self) -> str:
        return type(self).__name__

    def _rows(self) -> list[tuple[str, ...]]:
        found = [(f.name, getattr(self, f.name)) for f in dataclasses.fields(self)]  # type: ignore[arg-type]
        return [field_cells(name, self.UNITS.get(name, ""), value) for name, value in found if value is not None]

    def __repr__(self) -> str:
        return text_table(self._title(), self._rows())

    def _repr_html_(self) -> str:
        return html_table(self._title(), self.HEADS, self._rows())


def field_cells(name: str, unit: str, value: Any) -> tuple[str, str, str, str]:
    """Name, unit, shape and value of anything that a result holds.

    >>> field_cells("pressure", "Pa", 2e4), field_cells("quality", "", {"drift": 1e-9, "angle": 2.0})
    (('pressure', 'Pa', '', '20000'), ('quality', '', '2 entries', 'drift, angle'))
    """
    if hasattr(value, "dtype") and hasattr(value, "item") and getattr(value, "ndim", None) == 0:
        value = value.item()
    if isinstance(value, bool) or value is None:
        return name, unit, "", str(value).lower()
    if isinstance(value, (int, float)):
        return name, unit, "", f"{value:.6g}" if isinstance(value, float) else str(value)
    if isinstance(value, Mapping):
        return name, unit, _entries(len(value)), _shortened(", ".join(map(str, value)))
    if isinstance(value, (tuple, list)) and not all(isinstance(x, (int, float)) for x in value):
        kinds = list(dict.fromkeys(x if isinstance(x, str) else type(x).__name__ for x in value))
        return name, unit, _entries(len(value)), _shortened(", ".join(kinds))
    kind: Any = getattr(value, "dtype", None)
    if kind is not None and kind.kind not in "fiub":
        return name, unit, " × ".join(map(str, getattr(value, "shape", ()))), str(kind)
    if kind is not None or isinstance(value, (tuple, list)):
        cells = array_cells(name, unit, value)
        few = getattr(value, "ndim", 1) == 1 and 0 < len(value) <= FEW
        return (*cells[:3], ", ".join(f"{float(x):.6g}" for x in value)) if few else cells
    title: Any = getattr(value, "_title", None)
    if callable(title):
        return name, unit, "", _shortened(str(title()))
    if dataclasses.is_dataclass(value):
        return name, unit, "", type(value).__name__
    return name, unit, "", _shortened((str(value).splitlines() or [""])[0])


def _entries(count: int) -> str:
    return f"{count} {'entry' if count == 1 else 'entries'}"


def _shortened(text: str, length: int = 70) -> str:
    return text if len(text) <= length else text[: length - 1].rsplit(" ", 1)[0] + " …"
