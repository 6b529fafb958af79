"""What a command prints: a table for people, or the same data as JSON."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

__all__ = ["csv_text", "number", "print_json", "print_table"]

_WIDTH_OF_A_FILE = 140
_GAP = 3  # between columns, as rich sets it
_WORDS = 16  # room that a column of words asks for; they are folded


def print_json(data: Any) -> None:
    """Print `data` as JSON; a number that JSON has no word for (infinite, not a number) becomes null."""
    json.dump(_plain(data), sys.stdout, indent=2, ensure_ascii=False, allow_nan=False)
    sys.stdout.write("\n")


def print_table(columns: Sequence[str], rows: Iterable[Sequence[object]], *, title: str | None = None) -> None:
    """Print rows under column heads; numbers by `number`, everything else as text.

    Numbers are never broken: columns that do not fit beside one another follow in a table of their own below, the first column with them.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(width=None if sys.stdout.isatty() else _WIDTH_OF_A_FILE)
    body = [list(row) for row in rows]
    cells = [[number(cell) if isinstance(cell, float) else str(cell) for cell in row] for row in body]
    broken = [any(not isinstance(row[k], (int, float)) for row in body) for k in range(len(columns))]
    longest = [max(len(head), *(len(row[k]) for row in cells), 0) for k, head in enumerate(columns)]
    widths = [min(longest[k], max(_WORDS, len(head))) if broken[k] else longest[k] for k, head in enumerate(columns)]
    groups = _groups(widths, console.width)
    # a terminal narrower than two numbers wraps the line itself; a table would cut a number short
    needed = max((sum(widths[k] + _GAP for k in group) for group in groups), default=0)
    console = Console(width=max(console.width, needed))
    for n, group in enumerate(groups):
        table = Table(
            title=Text(title) if title and n == 0 else None, box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False
        )
        for k in group:
            table.add_column(Text(columns[k]), overflow="fold", no_wrap=not broken[k])
        for row in cells:
            table.add_row(*(Text(row[k]) for k in group))
        console.print(table)


def _groups(widths: Sequence[int], room: int) -> list[list[int]]:
    """Columns that fit beside one another, the first one in every group.

    >>> _groups([4, 30, 30, 30], 80), _groups([4, 30], 20)
    ([[0, 1, 2], [0, 3]], [[0, 1]])
    """
    groups: list[list[int]] = [[0]] if widths else []
    for k in range(1, len(widths)):
        taken = sum(widths[j] + _GAP for j in groups[-1])
        if len(groups[-1]) > 1 and taken + widths[k] + _GAP > room:
            groups.append([0])
        groups[-1].append(k)
    return groups


def csv_text(columns: Mapping[str, Any]) -> str:
    """Columns (arrays of one length, by name) as comma-separated text; every number reads back as the same one.

    >>> csv_text({"t": [0.0, 0.1], "status": [0, 0]})
    't,status\\n0.0,0\\n0.1,0\\n'
    """
    rows = zip(*(column.tolist() if hasattr(column, "tolist") else column for column in columns.values()), strict=True)
    return "".join(f"{','.join(map(str, row))}\n" for row in [tuple(columns), *rows])


def number(value: float) -> str:
    """Six significant digits, without trailing zeros; zero has no sign.

    >>> number(1.0e8), number(0.25), number(-0.0)
    ('1e+08', '0.25', '0')
    """
    return f"{value + 0.0:.6g}"


def _plain(data: Any) -> Any:
    if isinstance(data, Mapping):
        return {str(key): _plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple | set | frozenset):
        return [_plain(value) for value in data]
    if isinstance(data, float) and not math.isfinite(data):
        return None
    if data is None or isinstance(data, str | bool | int | float):
        return data
    if isinstance(data, Path):
        return str(data)
    if hasattr(data, "tolist"):  # numpy arrays and numbers, without importing numpy here
        return _plain(data.tolist())
    raise TypeError(f"{type(data).__name__} has no JSON form")
