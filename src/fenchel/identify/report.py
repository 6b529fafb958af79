"""The report: one HTML file with everything in it, the same numbers as JSON, and the law as files.

The findings come first, the least flattering at the head; then the law and its intervals; then the figures in the order in
which a mechanician looks at them; then the quality of the runs. Nothing is fetched from anywhere.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from ..drawing import Signs, picture
from ..errors import StorageError
from .html import figure_html, page_html, table_html
from .identification import Identification
from .jsonable import jsonable
from .law_file import write_law
from .report_tables import Table, tables
from .runs_info import RunsInfo, quality_notes

__all__ = ["figures", "write_report"]


@dataclass(frozen=True)
class _Figure:
    key: str
    caption: str
    draw: Callable[[], Any]
    kind: str = "svg"


def figures(found: Identification, info: RunsInfo, signs: Signs) -> list[_Figure]:
    """The figures of the report in order, drawn when asked; those without data are left out."""
    from .estimate_view import estimate_figure
    from .figure_numbers import energy_figure, residual_figure, yield_figure
    from .figure_sample import sample_figure
    from .figure_tests import fit_figure, mismatch_figure, phase_figure, strain_figure, stress_figure, wire_figure

    out = []
    if info.sample is not None:
        view = info.sample
        out.append(_Figure("sample", "The sample.", lambda: sample_figure(view), "png"))
    out += [
        _Figure(
            "intervals",
            "The identified values (dots) with the interval in which another sample is expected, over themselves; rings: single samples.",
            lambda: estimate_figure(found.law_estimates),
        ),
        _Figure(
            "stress",
            "Stress–strain curves, with wires and with the same beads unlinked.",
            lambda: stress_figure(found, signs),
        ),
        _Figure("fit", "The law (black) over the tests; the error is rms / max|q|.", lambda: fit_figure(found, signs)),
        _Figure("volume", "Volume strain: not fitted. The law is associated.", lambda: strain_figure(found, signs)),
        _Figure("phases", "Stress of the phases.", lambda: phase_figure(found, signs)),
        _Figure(
            "wires",
            "Wire stress against strain, with the identified unilateral law.",
            lambda: wire_figure(found, signs),
        ),
        _Figure("mismatch", "Do the phases share one strain?", lambda: mismatch_figure(found, signs)),
        _Figure(
            "yield",
            "Yield: first legs in the plane of the sand's own mean pressure. The equivalent stress is √J₂ = q/√3, not q.",
            lambda: yield_figure(found),
        ),
    ]
    if any(set(s.values) & {"natural_map", "change", "unbalanced"} for s in info.series):
        out.append(
            _Figure(
                "residuals", "Residuals of the contact solver along the tests.", lambda: residual_figure(info.series)
            )
        )
    for s in info.series:
        if "external" in s.values:
            out.append(_Figure("energy", "Energy balance of one test.", lambda s=s: energy_figure(s)))
            break
    return out


def _table(table: Table) -> str:
    return table_html(table.key, table.caption, table.head, table.rows, folded=table.folded)


def _image(figure: _Figure) -> str:
    return figure_html(figure.key, figure.caption, picture(figure.draw(), figure.kind), figure.kind)


def _page(found: Identification, info: RunsInfo, signs: Signs) -> str:
    drawn = {f.key: _image(f) for f in figures(found, info, signs)}
    table = {key: _table(t) for key, t in tables(found, info).items()}

    def put(*keys: str) -> str:
        return "".join(drawn.get(key, "") + table.get(key, "") for key in keys)

    sentences = "".join(
        f"<li{' class=first' if k == 0 else ''}>{escape(text)}</li>" for k, text in enumerate(found.findings)
    )
    notes = "".join(f"<p>{escape(text)}</p>" for text in (*info.notes, *quality_notes(info.quality)))
    stiffness = f"<p>{escape(info.stiffness_note)}</p>" if info.stiffness_note and info.stiffness else ""
    first = f"{found.fitted[0] / 1e3:g}kPa"
    files = "".join(f"<li><code>{escape(name)}</code></li>" for name in info.files)
    parts = [
        f"<h1>{escape(info.title)}</h1>",
        "<p>How well a law with linear hardening follows these grains: what was found, the least flattering first. A replay good to "
        "ten or twenty per cent is what such a law can do; the figures below show where it fails.</p>",
        f'<ul class="findings">{sentences}</ul>{notes}',
        "<h2>The law</h2>",
        put("values", "intervals", "stages"),
        f"<p>Run it: <code>fenchel drive law.py:law path_{first}.csv --parameters parameters_{first}.toml</code></p>",
        "<h2>Tests and replay</h2>",
        f"<p>Axes: {escape(signs.name)}; q is positive when the sample is pressed along z.</p>",
        put("sample", "stress", "fit", "predictions", "volume"),
        "<h2>Phases and wires</h2>",
        put("phases", "wires", "mismatch", "control", "control_values"),
        "<h2>Elasticity and yield</h2>",
        put("elastic", "yield", "readings", "by_pressure"),
        "<h2>Quality of the runs</h2>" if info.quality or info.series or info.stiffness else "",
        put("quality", "quality_runs", "residuals", "energy", "stiffness"),
        stiffness,
        "<h2>Settings</h2>" if info.settings or info.seconds or info.versions else "",
        put("settings", "seconds", "versions"),
        f"<h2>Run files</h2><ul>{files}</ul>" if files else "",
        f"<footer>Identification {found.seconds:.1f} s; the same numbers in <code>report.json</code>.</footer>",
    ]
    return page_html(info.title, "".join(parts))


def write_report(
    found: Identification, runs_info: RunsInfo, directory: Path | str, *, signs: str = "tension-positive"
) -> Path:
    """Write `report.html`, `report.json`, `law.py`, and a path and a parameter file per pressure; returns the path of the HTML.

    `signs`: "tension-positive" or "compression-positive", for the axes. Raises `StorageError` when a file cannot be written.
    """
    folder = Path(directory)
    axes = Signs(signs)
    # the pictures' data (positions, series) stay in the run files
    info = {key: jsonable(value) for key, value in vars(runs_info).items() if key not in ("sample", "series")}
    info["notes"] = [*runs_info.notes, *quality_notes(runs_info.quality)]
    numbers = {"identification": found.to_json(), "runs": info}
    text = json.dumps(numbers, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        page = _page(found, runs_info, axes)
        (folder / "report.json").write_text(text, encoding="utf-8")
        write_law(found, folder)
        (folder / "report.html").write_text(page, encoding="utf-8")
    except OSError as reason:
        raise StorageError(f"{folder}: the report cannot be written: {reason.strerror or reason}") from None
    return folder / "report.html"
