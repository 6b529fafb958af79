"""The report of a law fitted to laboratory tests: one HTML file, the same numbers as JSON, the law and its paths as files.

What is least flattering comes first. Everything is made before anything is written.
"""

from __future__ import annotations

import json
from html import escape
from math import isfinite, isnan
from pathlib import Path
from typing import Any

from .. import __version__
from ..drawing import Signs, picture
from ..errors import StorageError
from .estimate_view import estimate_figure
from .findings import friction_words
from .html import figure_html, page_html, table_html
from .jsonable import jsonable
from .laboratory_figures import CONES, curve_figure, path_figure
from .laboratory_fit import LaboratoryFit, LaboratoryReplay
from .laboratory_law import laboratory_files
from .report_tables import estimate_row, number

__all__ = ["laboratory_findings", "laboratory_json", "write_laboratory_report"]

POOR = 0.1  # relative error above which the report speaks of it
TITLE = "A law fitted to laboratory tests"


def _second(drained: bool) -> str:
    return "volume strain" if drained else "pore pressure"


def _called(replay: LaboratoryReplay) -> str:
    return f"{replay.test.name} at {replay.test.pressure / 1e3:g} kPa"


def laboratory_findings(fit: LaboratoryFit) -> list[str]:
    """What is to be known of a fit, in sentences, the least flattering first."""
    out = []
    fitted = [r for r in fit.replays if not r.held_out]
    worst = max(fitted, key=lambda r: max(r.error_q, r.error_second))
    out.append(
        f"Fitted to {len(fitted)} test{'s' * (len(fitted) > 1)}; the worst, {_called(worst)}, is off by {worst.error_q:.1%} in q and "
        f"{worst.error_second:.1%} in {_second(worst.test.drained)} (root mean square over largest value)."
    )
    for replay in fit.replays:
        if replay.held_out:
            out.append(
                f"Held out, {_called(replay)}: predicted with an error of {replay.error_q:.1%} in q and "
                f"{replay.error_second:.1%} in {_second(replay.test.drained)}."
            )
    if fit.law_name in CONES and fit.law_name != "drucker_prager_cap":  # there the cap may yield first
        out += friction_words(fit.values["theta_f"], fit.values["C_0"])
    for e in fit.estimates.values():
        if e.note and e.note != "held":
            out.append(f"{e.name}: {e.note}.")
    if fit.volume_weight > 0.0 and any(r.error_second > POOR for r in fitted):
        out.append(
            "The law does not follow the volume strain or pore pressure. Its flow is associated: it dilates as much as its friction says, "
            "from first yield on. A volume weight of 0 fits q alone."
        )
    if any(max(r.error_q, r.error_second) > POOR for r in fitted):
        out.append("The intervals hold for this law as if it were right; they do not say how far it is from the soil.")
    if len(fitted) < 2:
        out.append(
            "One test says how the law fits, not how it extrapolates: friction and cohesion want several pressures."
        )
    return out


def laboratory_json(fit: LaboratoryFit) -> dict[str, Any]:
    """The numbers of a fit, without the curves."""
    return {
        "law": fit.law_name,
        "values": fit.values,
        "fitted": list(fit.fitted),
        "estimates": {name: jsonable(e) for name, e in fit.estimates.items()},
        "tests": [
            {
                "name": r.test.name,
                "pressure": r.test.pressure,
                "drained": r.test.drained,
                "held_out": r.held_out,
                "rows": len(r.test.q),
                "error_q": r.error_q,
                f"error_{'volume_strain' if r.test.drained else 'pore_pressure'}": r.error_second,
                "notes": list(r.test.notes),
            }
            for r in fit.replays
        ],
        "misfit": fit.misfit,
        "condition": None if not isfinite(fit.condition) else fit.condition,
        "confidence": fit.confidence,
        "volume_weight": fit.volume_weight,
        "findings": laboratory_findings(fit),
        "version": __version__,
    }


def _values_table(fit: LaboratoryFit) -> str:
    rows = []
    for e in fit.estimates.values():
        row = estimate_row(e.name, e)
        start = "—" if isnan(e.start) else number(e.start * _ratio(e.unit, row[3]))
        rows.append((*row[:4], start, *row[4:]))
    return table_html(
        "values",
        f"Parameters. {fit.confidence:.0%} intervals from the residuals, widened where they follow one another, or from leaving out "
        "each file where that is wider; they are for these specimens, not for another deposit.",
        ("", "value", "interval", "unit", "start", "from", "remark"),
        rows,
    )


def _ratio(unit: str, shown: str) -> float:
    return {"MPa": 1e-6, "kPa": 1e-3}.get(shown, 1.0) if unit == "Pa" else 1.0


def _tests_table(fit: LaboratoryFit) -> str:
    rows = [
        (
            r.test.name,
            f"{r.test.pressure / 1e3:g}",
            "drained" if r.test.drained else "undrained",
            "predicted" if r.held_out else "fitted",
            str(len(r.test.q)),
            f"{r.error_q:.2%}",
            f"{r.error_second:.2%} ({_second(r.test.drained)})",
            "; ".join(r.test.notes),
        )
        for r in fit.replays
    ]
    head = ("test", "pressure [kPa]", "water", "use", "rows", "error of q", "other error", "notes")
    return table_html("tests", "Tests and replay: error is rms / largest magnitude", head, rows)


def _page(fit: LaboratoryFit, signs: Signs, files: list[str]) -> str:
    sentences = "".join(
        f"<li{' class=first' if k == 0 else ''}>{escape(text)}</li>" for k, text in enumerate(laboratory_findings(fit))
    )
    path = next(name for name in files if name.startswith("path_"))
    curves = figure_html(
        "curves",
        "Measured (colour) and the law (black): the tests, and what the law makes of their axial strain.",
        picture(curve_figure(fit, signs)),
    )
    paths = figure_html(
        "paths",
        "Effective stress paths. q is √(3 J₂) in triaxial tests; the √J₂ of the law is q/√3.",
        picture(path_figure(fit, signs)),
    )
    intervals = ""
    if fit.fitted:
        intervals = figure_html(
            "intervals",
            f"The fitted values with their intervals ({fit.confidence:.0%}), over themselves.",
            picture(estimate_figure({name: fit.estimates[name] for name in fit.fitted})),
        )
    listed = "".join(f"<li><code>{escape(name)}</code></li>" for name in files)
    parts = [
        f"<h1>{TITLE}</h1>",
        f'<ul class="findings">{sentences}</ul>',
        "<h2>The law</h2>",
        f"<p>Law <code>{escape(fit.law_name)}</code>; stresses are effective. Run it: "
        f"<code>fenchel drive law.py:law {escape(path)}</code></p>",
        _values_table(fit),
        intervals,
        f"<p>Condition number of the fitted columns: {number(fit.condition, 3)}. Weight of volume strain and pore pressure against q: "
        f"{fit.volume_weight:g}.</p>",
        "<h2>Tests and replay</h2>",
        f"<p>Axes: {escape(signs.name)}; q is positive when the sample is pressed along its axis.</p>",
        curves,
        _tests_table(fit),
        paths,
        f"<h2>Files</h2><ul>{listed}</ul>",
        "<footer>The same numbers in <code>report.json</code>; paths are tension positive, in SI units.</footer>",
    ]
    return page_html(TITLE, "".join(parts))


def write_laboratory_report(
    fit: LaboratoryFit, directory: Path | str, *, signs: str = "compression-positive", law_file: Path | None = None
) -> Path:
    """Write `report.html`, `report.json`, `law.py` and a path per test; returns the path of the HTML.

    `signs` is for the axes; `law_file` is where a law that is not of the library was declared, and goes along as a copy. Raises
    `StorageError` when a file cannot be written.
    """
    folder = Path(directory)
    files = laboratory_files(fit, laboratory_findings(fit), law_file)
    numbers = json.dumps(laboratory_json(fit), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    out = files | {"report.json": numbers, "report.html": _page(fit, Signs(signs), list(files))}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in out.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as reason:
        raise StorageError(f"{folder}: the report cannot be written: {reason.strerror or reason}") from None
    return folder / "report.html"
