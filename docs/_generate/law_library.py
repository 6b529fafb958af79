"""The library of laws: a page per law, written from its declaration before the build reads its pages, and the directive `law-list`.

Potentials, parameters, source and worked value come from the declaration and its entry, the text above them from the docstring of the
file. The pages are notebooks: the picture, Table 1 and the worked step are computed when they are built, and a wrong one fails.
They are not kept: `docs/reference/laws` is made anew, so that a law that is added to the registry has its page.
"""

from __future__ import annotations

import importlib
import math
import re
import sys
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from docutils import nodes
from prose import paragraphs
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sympy import latex

from fenchel.potentials import Law
from fenchel.potentials.library import ENTRIES, Entry

HEAD = """\
---
file_format: mystnb
kernelspec:
  display_name: Python 3
  name: python3
---
"""
CELLS = """\
## Its picture

At the values above; *Look at a law* says what the panels show.

```{{code-cell}} python
from fenchel.potentials.library import ENTRIES

entry = ENTRIES["{name}"]
law, values, temperatures = entry.law, entry.values, entry.worked.temperatures
law.plot(**values, **temperatures)
```

## Table 1

```{{code-cell}} python
law.table("strain")
```

```{{code-cell}} python
law.table("stress")
```

## Is it admissible?

Convexity of ψ and φ\\*, and with them a dissipation that is not negative, for all values within the bounds:

```{{code-cell}} python
report = law.check()
assert report.admissible
report
```

## A step whose answer is known

{known}

```{{code-cell}} python
import numpy as np

known = entry.worked
step = law.conic(known.eps, None, dt=known.dt, **values, **temperatures).solve()
difference = np.abs(step.stress - known.stress).max()
print("stress [Pa], Mandel:", step.stress)
print(f"largest difference from the known answer: {{difference:.1e}} Pa")
assert difference <= 10.0 ** (2 - known.digits) * np.abs(known.stress).max()
{state}```

## Use it

```python
from fenchel.potentials.library import {name}

update = {name}.compile("3d")  # compiled, for many points at once: update(eps, state, dt=..., **values)
```

```console
$ fenchel show {name}
$ fenchel drive {name} path.csv {words} -o history.csv
```
"""
STATE = """\
for variable, value in known.state.items():
    assert np.allclose(step.state[variable], value, rtol=1e-9, atol=1e-12), variable
"""


def page(name: str, entry: Entry) -> str:
    """The page of one law, as a notebook in Markdown."""
    law = entry.law
    text = importlib.import_module(f"fenchel.potentials.library._{name}").__doc__ or ""
    words = " ".join(f"-p {key}={value!r}" for key, value in entry.values.items())
    return "\n".join(
        [
            HEAD,
            f"(law-{name})=",
            f"# {name}",
            "",
            f"*{law.note[:1].upper()}{law.note[1:]}.* Source: {entry.source}.",
            "",
            *prose(text),
            "## Declared",
            "",
            *displayed(rf"\psi = {latex(law.energy)}"),
            *displayed(force_potential(law)),
            *variables(law),
            "## Parameters",
            "",
            *parameters(entry),
            CELLS.format(name=name, known=known(entry), state=STATE if entry.worked.state else "", words=words),
            "The path of a law with a temperature has a column `T` [K]." if law.temperature is not None else "",
        ]
    )


def prose(text: str) -> Iterator[str]:
    """A docstring as paragraphs and indented formulas."""
    for lines in paragraphs(text.splitlines()):
        if lines[0].startswith(" "):
            yield from ("```text", *textwrap.dedent("\n".join(lines)).splitlines(), "```", "")
        else:
            yield from (escaped(" ".join(lines)), "")


def escaped(text: str) -> str:
    """Text in which Markdown sees no markup but `names`."""
    pieces = text.split("`")
    return "`".join(
        piece if place % 2 else re.sub(r"([\\*_|$<\[])", r"\\\1", piece) for place, piece in enumerate(pieces)
    )


def displayed(text: str) -> Iterator[str]:
    """A displayed formula."""
    yield from ("```{math}", text, "```", "")


def force_potential(law: Law) -> str:
    """φ* as declared, or φ, or that there is none."""
    if law.phi is not None:
        return rf"\varphi = {law.phi.latex()}"
    return r"\varphi^* = I_{\{0\}}" if law.phi_star is None else rf"\varphi^* = {law.phi_star.latex()}"


def variables(law: Law) -> Iterator[str]:
    """Which symbols are observable, internal, and their forces."""
    said = f"Observable: ${latex(law.observable)}$."
    if law.internal:
        listed = ", ".join(rf"${latex(variable)}$ (force ${latex(law.forces[variable])}$)" for variable in law.internal)
        said += f" Internal: {listed}."
    if law.temperature is not None:
        said += f" Temperature: ${latex(law.temperature)}$."
    yield from (said, "")


def parameters(entry: Entry) -> Iterator[str]:
    """Name, symbol, unit, bounds, the value of the worked example, meaning."""
    yield "| parameter | symbol | unit | bounds | value | meaning |"
    yield "|---|---|---|---|---|---|"
    for symbol in entry.law.parameters:
        bounds = f"{symbol.lower:g} to {symbol.upper:g}" if math.isfinite(symbol.upper) else f"≥ {symbol.lower:g}"
        cells = (f"`{symbol.name}`", f"${latex(symbol)}$", symbol.unit, bounds, f"{entry.values[symbol.name]:g}")
        yield "| " + " | ".join((*cells, escaped(symbol.note))) + " |"
    yield from ("", "The values are plausible, not measured: they are those of the picture and of the worked step.", "")


def known(entry: Entry) -> str:
    """The worked value in words: the strain, what is given beside it, and where its answer comes from."""
    value = entry.worked
    given = f"Δt = {value.dt:g} s" + "".join(f", {k} = {v:g} K" for k, v in value.temperatures.items())
    strain = ", ".join(f"{x:.6g}" for x in value.eps)
    return (
        f"One implicit step from the virgin state, {given}, to the strain ({strain}), in Mandel components (11, 22, 33, √2·23, √2·13, "
        f"√2·12). Its answer is known without fenchel: {escaped(value.source)}. The cone program of the declaration gives it too, and "
        "the tests hold every compiled step of the law against it."
    )


def write(folder: Path, entries: Mapping[str, Entry] = ENTRIES) -> None:
    """One file per law; what is there and right is left alone, what belongs to no law is removed."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.md"):
        if old.stem not in entries:
            old.unlink()
    for name, entry in entries.items():
        file, text = folder / f"{name}.md", page(name, entry)
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


class LawList(SphinxDirective):
    """Every law of the library with its line, each a link to its page, in the order of the registry."""

    def run(self) -> list[nodes.Node]:
        self.env.note_dependency(str(Path(str(sys.modules["fenchel.potentials.library"].__file__))))
        lines = ["| law | what it is | source |", "|---|---|---|"]
        for name, entry in ENTRIES.items():
            lines.append(f"| [`{name}`](laws/{name}.md) | {escaped(entry.law.note)} | {escaped(entry.source)} |")
        lines += ["", "```{toctree}", ":hidden:", "", *(f"laws/{name}" for name in ENTRIES), "```"]
        return self.parse_text_to_nodes("\n".join(lines))


def setup(sphinx: Sphinx) -> dict[str, Any]:
    """Write the pages before they are read, and register the directive."""
    sphinx.connect("builder-inited", lambda app: write(Path(app.srcdir) / "reference" / "laws"))
    sphinx.add_directive("law-list", LawList)
    return {"parallel_read_safe": True, "version": "1"}
