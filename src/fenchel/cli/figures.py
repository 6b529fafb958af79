"""Figures from the command line: the option that names their file, and how they are written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

__all__ = ["figure_kind", "write_figure"]


def figure_kind(file: Path) -> str:
    """ "png" or "svg" by the name of the file; asked before the work, so that a wrong name costs nothing. `InputError` for others."""
    from fenchel.errors import InputError

    kind = file.suffix.lower().removeprefix(".")
    if kind not in ("png", "svg"):
        raise InputError(
            f"--plot {file}: the figure is written as .png or .svg: write --plot {file.stem.strip('-.') or 'figure'}.png"
        )
    return kind


def write_figure(figure: Any, file: Path) -> None:
    """Write a figure in one piece, so that a full disk leaves an older file as it was."""
    from fenchel.cache import replace_file
    from fenchel.drawing import picture

    replace_file(file.resolve(), picture(figure, figure_kind(file)))
