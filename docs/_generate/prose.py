"""Docstrings as the prose that they are: paragraphs, indented formulas and examples, `names` between single backticks.

autodoc would read them as reStructuredText, to which |x|, a*b and a_ are markup. Here every paragraph is escaped, what stands
between backticks becomes a literal, and an indented paragraph a literal block.
"""

from __future__ import annotations

import re
import textwrap
from typing import Any

from sphinx.application import Sphinx

BULLET = re.compile(r"[*-] ")


def inline(text: str) -> str:
    """One paragraph with everything that reStructuredText would take for markup escaped."""
    pieces = text.split("`")
    out = ""
    for place, piece in enumerate(pieces):
        if place % 2 and place < len(pieces) - 1 and piece and piece == piece.strip():
            before, after = pieces[place - 1][-1:], pieces[place + 1][:1]
            glue = (r"\ " if before.strip() else "", r"\ " if after.strip() else "")
            out += f"{glue[0]}``{piece}``{glue[1]}"
        else:
            out += re.sub(r"([\\*|_`])", r"\\\1", piece)
    return out


def paragraphs(lines: list[str]) -> list[list[str]]:
    """The lines between blank ones; a line that is indented after one that is not begins a paragraph of its own."""
    found: list[list[str]] = [[]]
    for text in lines:
        if not text.strip():
            found.append([])
            continue
        last = found[-1]
        bulleted = bool(last) and bool(BULLET.match(last[0]))
        turned = bool(last) and (text[0] == " ") != (last[-1][0] == " ") and not bulleted
        if turned or (last and BULLET.match(text)):
            found.append([])
        found[-1].append(text)
    return [paragraph for paragraph in found if paragraph]


def rewrite(lines: list[str]) -> list[str]:
    """The same docstring in reStructuredText."""
    out: list[str] = []
    for paragraph in paragraphs(lines):
        first = paragraph[0]
        if first.startswith(">>>"):
            out += [*paragraph, ""]
        elif first.startswith(" "):
            out += ["::", "", *textwrap.indent(textwrap.dedent("\n".join(paragraph)), "    ").splitlines(), ""]
        elif BULLET.match(first):
            out += ["* " + inline(" ".join([first[2:], *(text.strip() for text in paragraph[1:])])), ""]
        else:
            out += [inline(" ".join(paragraph)), ""]
    return out


def process(_sphinx: Sphinx, _what: str, _name: str, _thing: Any, _options: Any, lines: list[str]) -> None:
    """The event of autodoc; it changes `lines` in place."""
    lines[:] = rewrite(lines)


def setup(sphinx: Sphinx) -> dict[str, Any]:
    """Connect to autodoc."""
    sphinx.connect("autodoc-process-docstring", process)
    return {"parallel_read_safe": True, "version": "1"}
