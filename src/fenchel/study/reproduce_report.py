"""The report of a reproduction: one HTML page with a table of the claims, every figure beside what the study shows, and all numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from .. import __version__
from ..dem.storage import replace_file
from ..drawing import picture
from ..identify.html import figure_html, page_html, table_html
from .claim import Claim, Part, Picture, Verdict
from .headline import Headline
from .notes import NOTES
from .reproduce import Reproduction
from .statistics import Mean

__all__ = ["write_reproduction"]

_STYLE = """
body{max-width:60rem}
.pass{color:#1b5e20}.fail{color:#a02020}.undecided{color:#7a5c00}
b.pass::before{content:"\\2713 "}b.fail::before{content:"\\2717 "}b.undecided::before{content:"? "}
.pair{display:flex;gap:1.2rem;align-items:center}.pair figure{flex:3}
.pair p{flex:1;font-size:.9rem;color:#555;border-left:2px solid #ddd;padding-left:.8rem}
@media(max-width:45rem){.pair{display:block}}
article{margin:1.2rem 0;border-top:1px solid #eee}article p{margin:.3rem 0}
.criterion{font-size:.9rem;color:#555}
td:not(:first-child){white-space:normal}
"""

_KINDS = {"T": "theorem", "N": "number", "Q": "quality", "A": "assumption"}


def _number(x: float | None, unit: str = "1") -> str:
    if x is None or x != x:
        return "–"
    text = f"{x:.3g}"
    return text if unit in ("1", "") else f"{text} {unit}"


def _interval(v: Verdict) -> str:
    if v.value is None:
        return "–"
    if v.low is None or v.high is None:
        return _number(v.value, v.unit)
    return f"{v.value:.3g} [{v.low:.3g}, {v.high:.3g}]" + ("" if v.unit == "1" else f" {v.unit}")


def _badge(outcome: str) -> str:
    return f'<b class="{outcome}">{outcome}</b>'


def _overview(found: Reproduction) -> str:
    rows = []
    for n, v in found.verdicts.items():
        claim = found.claims[n]
        rows.append(
            f'<tr><td><a href="#claim-{n}">{n}</a></td><td>{claim.kind}</td><td>{escape(claim.text)}</td>'
            f"<td>{_badge(v.outcome)}</td><td>{escape(_interval(v))}</td></tr>"
        )
    head = "".join(f"<th>{h}</th>" for h in ("", "kind", "claim", "verdict", "figure [95 % interval]"))
    return f'<div class="scroll"><table id="claims"><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'


def _flat(values: Mapping[str, Any], before: str = "") -> list[tuple[str, str]]:
    rows: list[tuple[str, str]] = []
    for key, value in values.items():
        if isinstance(value, Mapping):
            rows += _flat(value, f"{before}{key}.")
        else:
            rows.append((before + str(key), _cell(value)))
    return rows


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        shown = [_cell(item) for item in value[:12]]
        return "[" + ", ".join(shown) + (", …]" if len(value) > 12 else "]")
    return str(value)


def _article(claim: Claim, v: Verdict) -> str:
    tables = "".join(
        table_html(f"{name}-{claim.number}", title, (name, "value"), _flat(values), folded=True)
        for name, title, values in (
            ("number", "All numbers", v.numbers),
            ("setting", "What they depend on", v.settings),
        )
        if values
    )
    needed = f" To decide: {escape(v.needed)}." if v.needed else ""
    return (
        f'<article id="claim-{claim.number}"><p><b>{claim.number} ({claim.kind}).</b> {escape(claim.text)} {_badge(v.outcome)}</p>'
        f'<p>{escape(v.sentence)}{needed}</p><p class="criterion">Passes when: {escape(claim.criterion)}</p>{tables}</article>'
    )


def _picture(p: Picture) -> str:
    figure = figure_html(p.key, p.caption, picture(p.draw(), p.kind), p.kind)
    return f'<div class="pair">{figure}<p>In the study: {escape(p.study)}</p></div>' if p.study else figure


def _part(found: Reproduction, part: Part) -> str:
    pictures = "".join(map(_picture, part.pictures(found.size, found.folder, found.results)))
    articles = "".join(_article(c, found.verdicts[c.number]) for c in part.claims if c.number in found.verdicts)
    return f"<h2>{part.letter}. {escape(part.title)}</h2>{pictures}{articles}"


def _mean(m: Mean, unit: str) -> str:
    text = m.text(".3g")
    return text if unit == "1" else f"{text} {unit}"


def _headlines(found: Sequence[Headline]) -> str:
    if not found:
        return ""
    names = list(found[0].change)
    head = ("result", "as it is", *(f"change with {name}" for name in names))
    rows = [[h.name, _mean(h.value, h.unit), *(_mean(h.change[n], h.unit) for n in names)] for h in found]
    failed = f"<p>Runs that did not converge: {escape(', '.join(found[0].failed))}.</p>" if found[0].failed else ""
    return (
        "<h2>Headline results and what moves them</h2><p>One setting changed at a time, on the same seeds: tolerance tenfold tighter, step "
        "halved, bead radius 0.3 instead of 0.4 mean radii, friction 0.5 instead of 0.4. The interval of the first column is the scatter "
        "over seeds.</p>"
        + table_html("headlines", "Values and changes with 95 % intervals over seeds", head, rows)
        + failed
    )


def _choice(found: Reproduction) -> str:
    from . import formulation_choice

    if found.choice is None:
        return ""
    head, rows = formulation_choice.table(found.choice)
    pictures = "".join(map(_picture, formulation_choice.pictures(found.results)))
    return (
        f"<h2>Which formulation to identify with</h2><p>{escape(formulation_choice.verdict_sentence(found.choice))}</p>"
        + table_html("choice", "The three costs on planted and on discrete data", head, rows)
        + pictures
    )


def write_reproduction(found: Reproduction, directory: Path) -> Path:
    """Write `report.html`; returns its path. Raises `StorageError` when it cannot be written."""
    total = len(found.verdicts)
    theorems = [n for n, c in found.claims.items() if "T" in c.kind]
    held = sum(found.verdicts[n].outcome == "pass" for n in theorems)
    counts = ", ".join(f"{found.count(o)} {o}" for o in ("pass", "fail", "undecided"))
    kinds = ", ".join(f"{k} {word}" for k, word in _KINDS.items())
    notes = "".join(f"<li>{n}. {escape(text)}</li>" for n, text in NOTES.items())
    settings = table_html("size", "The size", ("setting", "value"), _flat(vars(found.size)))
    body = [
        "<h1>Wire-reinforced sand, claim by claim</h1>",
        f"<p>{total} claims of the reference study (Laniel, Alart and Pagano, c. 2008) at size {found.size.name}: {counts}. Of "
        f"{len(theorems)} "
        f"theorems {held} hold. A claim that fails is a result: it did not reproduce with what is said beside it.</p>",
        f"<p>Kinds: {kinds}. The equivalent stress is √J₂ throughout.</p>",
        _overview(found),
        _headlines(found.headlines),
        _choice(found),
        *(_part(found, part) for part in found.parts),
        f"<h2>M. Notes on the text of the study</h2><ul>{notes}</ul>",
        f"<h2>Settings</h2>{settings}<footer>fenchel {__version__}; the same numbers in <code>claims.json</code>.</footer>",
    ]
    path = directory / "report.html"
    replace_file(path, page_html("Wire-reinforced sand, claim by claim", "".join(body), style=_STYLE).encode())
    return path
