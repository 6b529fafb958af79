"""The figure of a law: its surfaces in the meridian and the deviatoric plane, and ψ beside ψ*.

Everything drawn is a number of the declaration: the curves of `surface` and `energy_pair`; what is not drawn is said under the panels.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..drawing import FAINT, INK, MEASURES, Signs, shown, styled
from ..errors import DeclarationError, InputError
from .convex_section import USUAL
from .elastic_domain import Domain, domain_of
from .energy_pair import EnergyPair, energy_pair
from .history_path import Path, path_of
from .law import Law
from .law_panels import (
    DASHES,
    Curve,
    Drawing,
    deviatoric_panel,
    energy_panels,
    engineered,
    meridian_panel,
)
from .surface import COMPRESSION, Section, deviator, section_of

__all__ = ["law_figure"]

LEVELS = (0.5, 1.0, 1.5)


def law_figure(
    law: Law,
    values: Mapping[str, Any],
    *,
    history: Any = None,
    state: Mapping[str, Any] | None = None,
    pressure: float | None = None,
    angle: float | None = None,
    direction: Any = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    strain: float | None = None,
    size: float | None = None,
    limit: float | None = None,
    measure: str = "sqrt_J2",
    signs: str = "tension-positive",
) -> Any:
    """The `matplotlib.figure.Figure` of a law; see `Law.plot`, whose options these are (here a parameter may be called like one)."""
    factor = Signs(signs).factor
    if measure not in MEASURES:
        raise InputError(f"measure = {measure!r} is unknown: use {' or '.join(map(repr, MEASURES))}")
    if history is not None and state is not None:
        raise InputError("give a history, whose last row is the state, or a state, not both")
    path = None if history is None else path_of(law, values, history)
    now = state if path is None else path.state
    if strain is None:
        strain = 1e-3 if path is None else max(path.largest_strain, 1e-12)
    pair = energy_pair(law, values, direction=direction, strain=strain, state=now)
    drawing = _drawing(law, values, now, path, factor, measure, pressure, angle, size, limit)
    return _panels(law, values, drawing, pair, direction, factor)


@styled
def _panels(
    law: Law, values: Mapping[str, Any], drawing: Drawing | None, pair: EnergyPair, direction: Any, factor: float
) -> Any:
    from matplotlib.figure import Figure

    rows = 2 if drawing is not None and drawing.curves else 1
    figure = Figure(figsize=(7.6, 3.7 * rows + 0.5), layout="constrained")
    axes = figure.subplots(rows, 2, squeeze=False)
    notes = energy_panels(axes[-1], pair, direction, factor)
    if drawing is not None:
        if rows == 2:
            meridian_panel(axes[0, 0], drawing)
            deviatoric_panel(axes[0, 1], drawing)
            handles, labels = axes[0, 0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside upper right", ncols=2 if len(labels) > 3 else len(labels))
        notes = drawing.notes + notes
    notes = [_values_line(law, values), *notes] if values else notes
    figure.suptitle(law.name, fontsize=10.0, fontweight="bold", x=0.01, ha="left")
    figure.supxlabel("\n".join(_wrapped(notes)), fontsize=8.0, x=0.01, ha="left", color=INK)
    return shown(figure)


# -- what is drawn ------------------------------------------------------------------------------------------------------------------


def _drawing(
    law: Law,
    values: Mapping[str, Any],
    state: Mapping[str, Any] | None,
    path: Path | None,
    factor: float,
    measure: str,
    pressure: float | None,
    angle: float | None,
    size: float | None,
    limit: float | None,
) -> Drawing | None:
    """Curves of the law, None with nothing but notes missing: an elastic law says so."""
    try:
        virgin = domain_of(law, values)
        domain = virgin if not state else domain_of(law, values, state)
    except DeclarationError as reason:
        return Drawing(law, factor, measure, 0.0, 0.0, notes=[f"No surface: {reason}."])
    frame = None if path is None else path.frame
    if angle is None:
        angle = COMPRESSION if path is None else path.angle
    found = Drawing(law, factor, measure, angle, 0.0, domain.symbol, path=path)
    sets: list[tuple[str, Domain, Mapping[str, Any], bool]] = []
    if domain.functions:
        if state:
            sets.append(("virgin", virgin, dict(color=FAINT, linestyle=(0, (4, 2)), linewidth=1.0), False))
        sets.append(("", domain, {}, True))
    else:
        sets += _levels(found, domain, path, size)
    axes = _planes(angle, frame)
    meridians = _sections([one for _, one, _, _ in sets], axes[0], limit, False, path)
    if pressure is None:
        pressure = _pressure(path, meridians[-1], sets[-1][1])
    found.pressure = float(pressure)
    origin = -found.pressure * axes[0][0]
    deviatorics = _sections([one for _, one, _, _ in sets], axes[1], limit, True, path, origin)
    for (label, _, style, filled), first, second in zip(sets, meridians, deviatorics, strict=True):
        found.curves.append(Curve(label, first, second, style, filled))
    _remarks(found, domain)
    return found


def _planes(angle: float, frame: Any) -> tuple[Any, Any]:
    import numpy as np

    along = np.array([[1.0, 1.0, 1.0, 0.0, 0.0, 0.0], np.sqrt(2.0) * deviator(angle, frame)])
    return along, np.array([deviator(0.0, frame), deviator(np.pi / 2.0, frame)])


def _sections(
    domains: list[Domain], axes: Any, limit: float | None, equal: bool, path: Path | None, origin: Any = None
) -> list[Section | None]:
    """Sections of domains that are drawn together, those that are unbounded to one limit: that of the last."""
    import numpy as np

    found: list[Section | None] = []
    for domain in domains[::-1]:
        found.append(section := _section(domain, axes, limit, equal, path, origin))
        if limit is None and section is not None and section.unbounded:
            limit = float(np.abs(section.points).max())
    return found[::-1]


def _section(domain: Domain, axes: Any, limit: float | None, equal: bool, path: Path | None, origin: Any = None) -> Any:
    """Section of a domain, drawn at least as far as the path goes; None where the plane misses it."""
    import numpy as np

    origin = np.zeros(6) if origin is None else origin
    try:
        found = section_of(domain, origin, axes, limit, equal)
    except InputError:
        return None
    if path is not None and limit is None and found.unbounded:
        reached = np.abs(found.coordinates(path.tensors)).max()
        if reached > np.abs(found.points).max(axis=0)[0]:
            found = section_of(domain, origin, axes, 1.25 * float(reached), equal)
    return found


def _pressure(path: Path | None, section: Section | None, domain: Domain) -> float:
    """Where the deviatoric plane is put: at the last row of a path, else at zero, or in the middle of a domain on whose edge zero lies."""
    import numpy as np

    if path is not None:
        return -float(path.tensors[-1, :3].sum()) / 3.0
    if section is None:
        return 0.0
    width = float(np.ptp(section.points[:, 0]))
    edge = np.array([[1e-3, 1e-3, 1e-3, 0, 0, 0], [-1e-3, -1e-3, -1e-3, 0, 0, 0]]) * width
    return 0.0 if (domain.gap(edge) < 0.0).all() else -float(section.centre[0])


def _levels(found: Drawing, domain: Domain, path: Path | None, size: float | None) -> list[Any]:
    """Level sets of a finite φ*: where it vanishes, if that has an inside, and at a half, one and one and a half of a size of stress."""
    import numpy as np

    if size is None:
        size = path.size if path is not None and path.size > 0.0 else _size_of(found.law, domain)
    if not (np.isfinite(size) and size > 0.0):
        raise InputError(f"size = {size}: the stress of the picture must be positive")
    n = np.array([deviator(t) for t in np.linspace(0.0, 2.0 * np.pi, 7)])
    if not (domain.level(1e-6 * size * n) < np.inf).any():
        found.notes.append("No level set: the finite part of φ* has no value at small stresses.")
        return []
    sets: list[Any] = []
    start = 0.0
    if (domain.level(1e-6 * size * n) == 0.0).all():
        start = _threshold(domain, deviator(found.angle), size)
        sets.append(("φ* = 0", domain.below(0.0), {}, True))
    shades = ("#9ecae1", "#4292c6", "#084594")
    for k, part in enumerate(LEVELS):
        level = float(domain.level((start + part * size) * deviator(found.angle)[None])[0])
        if np.isfinite(level) and level > 0.0:
            style = dict(color=shades[k], linestyle=DASHES[(k + 1) % 4])
            sets.append((f"φ* = {level:.3g} W/m³", domain.below(level), style, False))
    if start:
        found.notes.append(
            "φ* is finite: drawn are the set where it vanishes, inside which nothing flows, and level sets."
        )
    else:
        sizes = ", ".join(engineered(part * size) for part in LEVELS)
        found.notes.append(f"φ* has no surface: drawn are its level sets through deviators of norm {sizes}.")
    return sets


def _threshold(domain: Domain, n: Any, size: float) -> float:
    """Length along n at which φ* begins to be positive."""
    low, high = 0.0, size
    while float(domain.level(high * n[None])[0]) <= 0.0 and high < 1e30:
        low, high = high, 2.0 * high
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if float(domain.level(middle * n[None])[0]) <= 0.0 else (low, middle)
    return high


def _size_of(law: Law, domain: Domain) -> float:
    """A stress that φ* knows: the largest of its parameters in Pa, a viscosity in Pa.s at a rate of 1/s, else 0.1 MPa."""
    symbols = {s for s in domain.viscous.free_symbols if s in law.parameters}
    for unit in ("Pa", "Pa.s"):
        found = [float(domain.fixed[s]) for s in symbols if getattr(s, "unit", "") == unit]
        if any(v > 0.0 for v in found):
            return min(v for v in found if v > 0.0)
    return USUAL


def _remarks(found: Drawing, domain: Domain) -> None:
    if not domain.stress:
        found.notes.append(
            f"The axes are those of the viscous stress ${domain.symbol}$, the force of {domain.variable}."
            if domain.variable == found.law.observable
            else f"The axes are the force ${domain.symbol}$ of {domain.variable}, which is not the stress less a constant in this law."
        )
    if any(c.meridian is None or c.deviatoric is None for c in found.curves):
        missing = [
            f"the {plane} plane has no point inside {'the domain' if not c.label else c.label}"
            for c in found.curves
            for plane, s in (("meridian", c.meridian), ("deviatoric", c.deviatoric))
            if s is None
        ]
        found.notes.append(f"Not drawn: {'; '.join(missing)}.")
    if any(s is not None and s.cut.all() for c in found.curves for s in (c.meridian, c.deviatoric)):
        found.notes.append("A plane without a curve meets no surface: all of its stresses are inside.")
    if any(s is not None and s.unbounded for c in found.curves for s in (c.meridian, c.deviatoric)):
        found.notes.append("What is unbounded is drawn to a limit, where its boundary is left open.")
    if found.path is not None:
        if found.path.frame is not None:
            found.notes.append("The axes 1, 2, 3 are the principal axes at the end of the path.")
        found.notes.append("The path is projected on either plane; the surfaces are those at its end.")


def _values_line(law: Law, values: Mapping[str, Any]) -> str:
    units = {p.name: "" if p.unit in ("", "1") else f"\u00a0{p.unit}" for p in law.parameters}
    if law.temperature is not None:
        units[law.temperature.name] = "\u00a0K"
    return ", ".join(f"{name}\u00a0=\u00a0{float(value):.4g}{units.get(name, '')}" for name, value in values.items())


def _wrapped(notes: list[str]) -> list[str]:
    import textwrap

    return [line for note in notes for line in textwrap.wrap(note, 122)]
