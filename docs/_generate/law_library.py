"""Directive `law-library`: a section per law of the library, taken from the registry at build.

Potentials, parameters, source and worked value come from the declaration and its entry, the text above them from the docstring of the file.
"""

from __future__ import annotations

import importlib
import math
import textwrap
from typing import Any

from docutils import nodes
from file_keys import paragraph
from prose import paragraphs
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sympy import latex

from fenchel.potentials import Law
from fenchel.potentials.library import ENTRIES, Entry

HEADS = ("parameter", "symbol", "unit", "bounds", "value", "meaning")
WIDTHS = (14, 10, 12, 14, 14, 36)


class LawLibrary(SphinxDirective):
    """One section per law, in the order of the registry."""

    def run(self) -> list[nodes.Node]:
        return [self.section(name, entry) for name, entry in ENTRIES.items()]

    def section(self, name: str, entry: Entry) -> nodes.section:
        law = entry.law
        identifier = nodes.make_id(f"law-{name}")
        section = nodes.section("", nodes.title(text=name), ids=[identifier], names=[identifier])
        section += prose(importlib.import_module(f"fenchel.potentials.library._{name}").__doc__ or "")
        section += formula(rf"\psi = {latex(law.energy)}")
        section += formula(force_potential(law))
        section += parameters(entry)
        section += worked(entry)
        return section


def prose(text: str) -> list[nodes.Node]:
    """A docstring as paragraphs and indented formulas."""
    found: list[nodes.Node] = []
    for lines in paragraphs(text.splitlines()):
        if lines[0].startswith(" "):
            shown = textwrap.dedent("\n".join(lines))
            found.append(nodes.literal_block(shown, shown, language="text"))
        else:
            found.append(paragraph(" ".join(lines)))
    return found


def formula(text: str) -> nodes.math_block:
    """A displayed formula."""
    return nodes.math_block(text, text, nowrap=False, number=None, label=None)


def force_potential(law: Law) -> str:
    """φ* as declared, or φ, or that there is none."""
    if law.phi is not None:
        return rf"\varphi = {law.phi.latex()}"
    return r"\varphi^* = I_{\{0\}}" if law.phi_star is None else rf"\varphi^* = {law.phi_star.latex()}"


def parameters(entry: Entry) -> nodes.table:
    """Name, symbol, unit, bounds, the value of the worked example, meaning."""
    rows = []
    for symbol in entry.law.parameters:
        bounds = f"[{symbol.lower:g}, {symbol.upper:g}]" if math.isfinite(symbol.upper) else f"≥ {symbol.lower:g}"
        cells = (symbol.name, latex(symbol), symbol.unit, bounds, f"{entry.values[symbol.name]:g}", symbol.note)
        rows.append(cells)
    group = nodes.tgroup(cols=len(HEADS))
    for width in WIDTHS:
        group += nodes.colspec(colwidth=width)
    head, body = nodes.thead(), nodes.tbody()
    head += row([nodes.Text(word) for word in HEADS])
    for name, tex, *rest in rows:
        body += row([nodes.literal(text=name), nodes.math(text=tex), *(nodes.Text(text) for text in rest)])
    group += head
    group += body
    return nodes.table("", group)


def worked(entry: Entry) -> list[nodes.Node]:
    """Source, and the worked value in a line each."""
    value = entry.worked
    given = f"Δt = {value.dt:g} s" + "".join(f", {k} = {v:g} K" for k, v in value.temperatures.items())
    items = [
        ("Source", entry.source),
        ("Worked value", f"one implicit step from the virgin state at the values above, {given}"),
        ("strain (Mandel)", listed(value.eps)),
        ("stress (Mandel)", f"{listed(value.stress)} Pa"),
        *((f"{name}", f"{v:.12g}" if isinstance(v, float) else listed(v)) for name, v in value.state.items()),
        ("from", value.source),
    ]
    found = nodes.field_list()
    for name, text in items:
        found += nodes.field("", nodes.field_name(text=name), nodes.field_body("", nodes.paragraph(text=text)))
    return [found]


def listed(numbers: Any) -> str:
    """Six components to twelve digits."""
    return "(" + ", ".join(f"{x:.12g}" for x in numbers) + ")"


def row(cells: list[nodes.Node]) -> nodes.row:
    """A row of one-paragraph cells."""
    found = nodes.row()
    for cell in cells:
        found += nodes.entry("", nodes.paragraph("", "", cell))
    return found


def setup(sphinx: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    sphinx.add_directive("law-library", LawLibrary)
    return {"parallel_read_safe": True, "version": "1"}
