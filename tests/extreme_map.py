"""Rows as a table in text and as a picture: a line of boxes per group, a box per cell, with its error over its bound."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from extreme_rows import Row

ORANGE, BLACK = "#f2b544", "#000000"
NEAR, FAR = (
    np.array([86, 165, 222]) / 255,
    np.array([226, 241, 252]) / 255,
)  # blues: at the bound, and a millionth of it or less
VERDICTS = ("right", "refused", "wrong")


def counted(rows: Sequence[Row]) -> str:
    """So many right, refused and wrong."""
    found = [row.verdict for row in rows]
    return ", ".join(f"{found.count(verdict)} {verdict}" for verdict in VERDICTS) + f" of {len(rows)} cells"


def share(row: Row) -> str:
    """Error over its bound: to one digit from a tenth on, else its power of ten; a word where there is none."""
    if row.message:
        return row.verdict
    if row.error == 0.0:
        return "exact"
    if not np.isfinite(row.ratio):
        return "∞"
    return f"{row.ratio:.1g}" if row.ratio >= 0.095 else rf"$\mathbf{{10^{{{np.log10(row.ratio):.0f}}}}}$"


def color(row: Row) -> Any:
    """Blue, the lighter the farther from the bound; orange; black: told apart by every eye, and by their words."""
    if row.verdict != "right":
        return ORANGE if row.verdict == "refused" else BLACK
    far = min(-np.log10(row.ratio) / 6.0, 1.0) if row.ratio > 0.0 else 1.0
    return tuple(NEAR + far * (FAR - NEAR))


def table(rows: Sequence[Row]) -> str:
    """Group, setting, error, bound, the quantity of both, and the note; a refusal with its words."""
    lines, group = [], None
    wide = max(len(row.setting) for row in rows)
    for row in rows:
        if row.group != group:
            group = row.group
            lines.append(f"\n{group}" if lines else group)
        if row.message:
            text = f"refused: {row.message.split('; strain')[0]}"
        else:
            text = f"{row.error:8.1e} of {row.bound:7.1e}   {row.what}" + (f"   ({row.note})" if row.note else "")
        lines.append(f"  {row.setting:{wide}}  {text}")
    return "\n".join(lines)


def lines_of(rows: Sequence[Row], width: int = 78) -> list[tuple[str, list[tuple[Row, list[str]]]]]:
    """Groups cut into lines of boxes that the names of their settings fit into, `width` letters a line at most three lines each."""
    found = []
    for group in dict.fromkeys(row.group for row in rows):
        cells = [row for row in rows if row.group == group]
        parts = 1
        while True:
            count = -(-len(cells) // parts)
            letters = max(width // count - 1, 4)
            names = [textwrap.wrap(row.setting, letters, break_long_words=False) for row in cells]
            if count <= 3 or (max(map(len, names)) <= 3 and max(len(t) for name in names for t in name) <= letters):
                break
            parts += 1
        boxes = list(zip(cells, names, strict=True))
        found += [(group if start == 0 else "", boxes[start : start + count]) for start in range(0, len(boxes), count)]
    return found


def picture(rows: Sequence[Row]) -> Any:
    """The map of the rows as a matplotlib figure."""
    import matplotlib.pyplot as plt

    lines = lines_of(rows)
    height = 0.62
    figure, axes = plt.subplots(figsize=(9.0, height * len(lines) + 0.7), layout="constrained")
    for y, (group, boxes) in enumerate(lines):
        part = 1.0 / len(boxes)
        label = "\n".join(textwrap.wrap(group, 26))
        axes.text(-0.012, y, label, ha="right", va="center", fontsize=9)
        for k, (row, name) in enumerate(boxes):
            ink = "white" if row.verdict == "wrong" else "black"
            box = plt.Rectangle(
                (k * part, y - 0.46), part, 0.92, facecolor=color(row), edgecolor="white", linewidth=1.5
            )
            axes.add_patch(box)
            middle = (k + 0.5) * part
            axes.text(middle, y - 0.40, "\n".join(name), ha="center", va="top", fontsize=7, color=ink, linespacing=0.95)
            axes.text(middle, y + 0.41, share(row), ha="center", va="bottom", fontsize=8.5, color=ink, weight="bold")
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(len(lines) - 0.5, -0.5)
    axes.set_axis_off()
    present = {row.verdict for row in rows}
    words = {
        "right": "right: error over its bound",
        "refused": "refused with a reason, as foreseen",
        "wrong": "wrong",
    }
    colors = {"right": tuple(NEAR + 0.4 * (FAR - NEAR)), "refused": ORANGE, "wrong": BLACK}
    shown = [verdict for verdict in VERDICTS if verdict in present]
    handles = [plt.Rectangle((0, 0), 1, 1, facecolor=colors[verdict]) for verdict in shown]
    figure.legend(handles, [words[v] for v in shown], loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure
