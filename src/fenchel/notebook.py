"""Results as a few lines in a terminal and as a table or a formula in a notebook (the ground floor: nothing of ours is below).

A result that holds arrays is shown by shape, unit and range, never by its numbers.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

__all__ = ["array_cells", "html_table", "math", "text_table"]


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
