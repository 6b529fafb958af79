"""Rows as a table in text and as a picture: a line of boxes per group, a box per cell, with the decades between its error and its bound."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from extreme_rows import Row

BLUE, ORANGE, BLACK = "#a6d3f0", "#f2b544", "#000000"  # told apart by every eye, and by their words
VERDICTS = ("right", "refused", "wrong")


def counted(rows: Sequence[Row]) -> str:
    """So many right, refused and wrong."""
    found = [row.verdict for row in rows]
    return ", ".join(f"{found.count(verdict)} {verdict}" for verdict in VERDICTS) + f" of {len(rows)} cells"


def decades(row: Row) -> str:
    """Decades of the error over its bound, rounded; a word where there is none."""
    if row.message:
        return row.verdict
    if row.error == 0.0:
        return "exact"
    return f"{np.log10(row.ratio):+.0f}".replace("-", "−") if np.isfinite(row.ratio) else "∞"


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
        share = 1.0 / len(boxes)
        label = "\n".join(textwrap.wrap(group, 26))
        axes.text(-0.012, y, label, ha="right", va="center", fontsize=9)
        for k, (row, name) in enumerate(boxes):
            color = {"right": BLUE, "refused": ORANGE, "wrong": BLACK}[row.verdict]
            ink = "white" if row.verdict == "wrong" else "black"
            box = plt.Rectangle((k * share, y - 0.46), share, 0.92, facecolor=color, edgecolor="white", linewidth=1.5)
            axes.add_patch(box)
            middle = (k + 0.5) * share
            axes.text(middle, y - 0.40, "\n".join(name), ha="center", va="top", fontsize=7, color=ink, linespacing=0.95)
            axes.text(middle, y + 0.41, decades(row), ha="center", va="bottom", fontsize=8.5, color=ink, weight="bold")
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(len(lines) - 0.5, -0.5)
    axes.set_axis_off()
    present = {row.verdict for row in rows}
    words = {
        "right": "right: decades of the error over its bound",
        "refused": "refused with a reason, as foreseen",
        "wrong": "wrong",
    }
    colors = {"right": BLUE, "refused": ORANGE, "wrong": BLACK}
    shown = [verdict for verdict in VERDICTS if verdict in present]
    handles = [plt.Rectangle((0, 0), 1, 1, facecolor=colors[verdict]) for verdict in shown]
    figure.legend(handles, [words[v] for v in shown], loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure
