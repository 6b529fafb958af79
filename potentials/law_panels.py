"""The panels of the figure of a law: meridian plane, deviatoric plane, ψ and ψ*."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..drawing import BLUE, FAINT, GREEN, INK, MEASURES, PURPLE, SKY, VERMILION, unit_scale
from .energy_pair import EnergyPair
from .history_path import Path
from .law import Law
from .surface import Section

__all__ = [
    "DASHES",
    "Curve",
    "Drawing",
    "deviatoric_panel",
    "energy_panels",
    "engineered",
    "meridian_panel",
]

COLOURS, DASHES = (BLUE, PURPLE, GREEN, SKY), ("-", "--", "-.", ":")
FILL = "#eef3f7"


@dataclass
class Drawing:
    """What the panels share: signs, measure, the planes, curves of every section, the path, and what is said under the figure."""

    law: Law
    factor: float
    measure: str
    angle: float
    pressure: float
    symbol: str = r"\sigma"
    curves: list[Curve] = field(default_factory=list)
    path: Path | None = None
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Curve:
    """A domain with its sections in both planes (None where the plane misses it) and how it is drawn."""

    label: str
    meridian: Section | None
    deviatoric: Section | None
    style: Mapping[str, Any]
    filled: bool = False


# -- panels -----------------------------------------------------------------------------------------------------------------------


def meridian_panel(ax: Any, drawing: Drawing) -> None:
    import numpy as np

    scale, unit = unit_scale(_largest(drawing, 0))
    size, name = MEASURES[drawing.measure]

    def place(points: Any) -> Any:
        return np.column_stack([drawing.factor * points[:, 0], size * points[:, 1]]) * scale

    symbol = drawing.symbol
    _curves(ax, drawing, 0, place)
    if drawing.path is not None:
        section = next((c.meridian for c in drawing.curves[::-1] if c.meridian is not None), None)
        if section is not None:
            _walk(ax, place(section.coordinates(drawing.path.tensors)))
    ax.axhline(0.0, color=FAINT, linewidth=0.8, zorder=1)
    ax.axvline(0.0, color=FAINT, linewidth=0.8, zorder=1)
    mean = rf"$\mathrm{{tr}}\,{symbol}/3$" if drawing.factor > 0 else rf"$p=-\mathrm{{tr}}\,{symbol}/3$"
    word = "mean stress" if drawing.factor > 0 else "mean pressure"
    ax.set_xlabel(f"{word} {mean} [{unit}]")
    here = np.degrees(drawing.angle) % 360.0
    up, down = _lode(here), _lode((here + 180.0) % 360.0)
    ax.set_ylabel(f"{name} [{unit}]\n+ {up}, − {down}", linespacing=1.4)
    ax.set_title("Meridian plane")


def deviatoric_panel(ax: Any, drawing: Drawing) -> None:
    import numpy as np

    scale, unit = unit_scale(_largest(drawing, 1))

    def place(points: Any) -> Any:
        # the first axis up, the others 120 degrees on
        return drawing.factor * np.column_stack([-points[:, 1], points[:, 0]]) * scale

    _curves(ax, drawing, 1, place)
    if drawing.path is not None:
        section = next((c.deviatoric for c in drawing.curves[::-1] if c.deviatoric is not None), None)
        if section is not None:
            _walk(ax, place(section.coordinates(drawing.path.tensors)))
    reach = _largest(drawing, 1) * scale
    for k in range(3):
        turn = 2.0 * np.pi * k / 3.0
        end = 1.15 * reach * np.array([-np.sin(turn), np.cos(turn)])
        ax.annotate(
            "", xy=end, xytext=(0.0, 0.0), arrowprops=dict(arrowstyle="->", color=FAINT, linewidth=0.8), zorder=1
        )
        ax.text(*(1.13 * end), rf"${_indexed(drawing.symbol, k + 1)}$", ha="center", va="center", color=INK)
    ax.set_xlim(-1.5 * reach, 1.5 * reach)
    ax.set_ylim(-1.3 * reach, 1.5 * reach)
    ax.set_aspect("equal")
    size, multiple = unit_scale(abs(drawing.pressure))
    mean = f"{0.0 - drawing.factor * drawing.pressure * size:.4g} {multiple}"
    name = rf"$\mathrm{{tr}}\,{drawing.symbol}/3$" if drawing.factor > 0 else "$p$"
    word = "" if drawing.factor > 0 else "\n(compression +)"
    ax.set_title(f"Deviatoric plane, {name} = {mean}")
    radius = rf"$\Vert\mathrm{{dev}}\,{drawing.symbol}\Vert=\sqrt{{2}}\,\sqrt{{J_2}}$"
    ax.set_xlabel(f"from the centre: {radius} [{unit}]{word}")


def _curves(ax: Any, drawing: Drawing, which: int, place: Any) -> None:
    import numpy as np

    for curve in drawing.curves:
        section = (curve.meridian, curve.deviatoric)[which]
        if section is None:
            continue
        corners = place(section.points)
        if curve.filled:
            ax.fill(corners[:, 0], corners[:, 1], color=FILL, linewidth=0.0, zorder=0)
        kinds = np.unique(section.active[~section.cut]) if not curve.style else np.array([-1])
        for kind in kinds:
            shown = ~section.cut if kind < 0 else ~section.cut & (section.active == kind)
            style = dict(curve.style) or dict(color=COLOURS[kind % 4], linestyle=DASHES[kind % 4])
            line = _broken(corners, shown)
            ax.plot(line[:, 0], line[:, 1], label=_label(drawing.law, curve, section, int(kind)), zorder=2, **style)


def _broken(corners: Any, shown: Any) -> Any:
    """The closed line through the corners with NaN in the place of the ways that are not shown."""
    import numpy as np

    # begun where a way that is not shown ends, so that no line has a seam
    first = int(np.argmin(shown)) + 1 if not shown.all() else 0
    corners, shown = np.roll(corners, -first, axis=0), np.roll(shown, -first)
    pieces = []
    for corner, seen in zip(corners, shown, strict=True):
        pieces.append(corner)
        if not seen:
            pieces.append(np.full(2, np.nan))
    return np.array([*pieces, corners[0]] if shown.all() else pieces)


def _label(law: Law, curve: Curve, section: Section, kind: int) -> str:
    if curve.label:
        return curve.label
    several = len(law.force_potential.surfaces) > 1 if law.force_potential is not None else False
    return f"$f_{{{kind + 1}}}=0$" if several else "$f=0$"


def _walk(ax: Any, points: Any) -> None:
    ax.plot(points[:, 0], points[:, 1], color=VERMILION, linewidth=1.2, label="path", zorder=3)
    ax.plot(*points[0], marker="o", markersize=4, markerfacecolor="white", color=VERMILION, zorder=4)
    ax.plot(*points[-1], marker="o", markersize=4, color=VERMILION, zorder=4)


def energy_panels(axes: Any, pair: EnergyPair, direction: Any, factor: float) -> list[str]:
    """ψ and ψ* with the tangents of one point; what is said about them."""
    import numpy as np

    left, right = axes
    rest = float(pair.at_rest)
    star = pair.stress * pair.strain - (pair.energy - rest)
    energy_scale, energy_unit = unit_scale(float(np.abs(np.concatenate([pair.energy - rest, star])).max()), "J/m³")
    stress_scale, stress_unit = unit_scale(float(np.abs(pair.stress).max()))
    t, s = factor * 100.0 * pair.strain, factor * pair.stress * stress_scale
    psi, star = (pair.energy - rest) * energy_scale, star * energy_scale
    left.plot(t, psi, color=BLUE)
    right.plot(s, star, color=GREEN, linewidth=1.5)
    if pair.how == "numerical":
        right.plot(s, (pair.conjugate + rest) * energy_scale, "o", markersize=3.5, color=INK)
    # the point that is marked: well inside the picture, on a side where the stress is not zero
    inside = (np.abs(t) <= 0.7 * np.abs(t).max()) & (s != 0.0)
    place = int(np.argmax(np.where(inside & (t > 0.0), t, np.where(inside, -1.0 / (1.0 + np.abs(t)), -2.0))))
    for ax, x, y, slope in (
        (left, t, psi, pair.stress[place] * energy_scale * factor / 100.0),
        (right, s, star, pair.strain[place] * energy_scale * factor / stress_scale),
    ):
        reach = 1.15 * x[place]
        ax.plot(
            [0.0, reach],
            [y[place] - slope * x[place], y[place] + slope * (reach - x[place])],
            color=VERMILION,
            linewidth=1.0,
            linestyle="--",
        )
        ax.plot(x[place], y[place], "o", markersize=4.5, color=VERMILION)
        ax.plot(0.0, y[place] - slope * x[place], "_", markersize=9, color=VERMILION)
        ax.axhline(0.0, color=FAINT, linewidth=0.8, zorder=1)
        ax.axvline(0.0, color=FAINT, linewidth=0.8, zorder=1)
    strain, stress = _direction_words(direction)
    word = "" if factor > 0 else ", compression +"
    left.set_xlabel(f"strain {strain} [%]{word}")
    right.set_xlabel(f"stress {stress} [{stress_unit}]{word}")
    left.set_ylabel(rf"$\rho\psi$ [{energy_unit}]")
    right.set_ylabel(rf"$\rho\psi^*$ [{energy_unit}]")
    left.set_title("Free energy")
    right.set_title(r"Its conjugate, at $\sigma=\rho\,\partial\psi/\partial\varepsilon$")
    a, b = psi[place], pair.stress[place] * pair.strain[place] * energy_scale
    c = b - a
    notes = [
        f"Fenchel–Young at the marked point: ψ + ψ* = {a:.4g} + {c:.4g} = {b:.4g} {energy_unit} = σ:ε.",
        "The tangents there (dashed) cut the ordinates at −ψ* and −ψ.",
    ]
    if rest != 0.0:
        notes.append(
            f"Both are shifted to be zero without strain: from ψ is taken its value there, {engineered(rest, 'J/m³')}; ψ* has it more."
        )
    if pair.how == "closed form":
        notes.append(f"ψ* is its closed form; |ψ + ψ* − σ:ε| ≤ {engineered(pair.residual, 'J/m³')} on the curve.")
    elif pair.how == "numerical":
        notes.append(
            f"ψ* has no closed form: dots are certified suprema (gap ≤ {engineered(pair.gap, 'J/m³')}), the line is σ:ε − ψ."
        )
    else:
        notes.append(f"One of the two is drawn by σ:ε less the other, as {pair.missing}.")
    return notes


# -- words ------------------------------------------------------------------------------------------------------------------------


def _largest(drawing: Drawing, which: int) -> float:
    import numpy as np

    sections = [s for c in drawing.curves if (s := (c.meridian, c.deviatoric)[which]) is not None]
    if which == 0:
        return max((float(np.abs(s.points).max()) for s in sections), default=1.0)
    reached = [float(np.hypot(*s.points.T).max()) for s in sections]
    if drawing.path is not None and sections:
        reached.append(float(np.hypot(*sections[-1].coordinates(drawing.path.tensors).T).max()))
    return max(reached, default=1.0)


def engineered(value: float, base: str = "Pa") -> str:
    scale, unit = unit_scale(abs(value), base)
    return f"{scale * value:.3g} {unit}"


def _lode(degrees: float) -> str:
    """A meridian in words: compression along or extension along an axis, else its angle."""
    for k in range(3):
        for start, word in ((0.0, "extension"), (180.0, "compression")):
            if abs((degrees - start - 120.0 * k + 180.0) % 360.0 - 180.0) < 0.05:
                return f"triaxial {word}"
    return rf"$\theta$ = {degrees:.4g}°"


def _indexed(symbol: str, k: int) -> str:
    return rf"\sigma^{{ir}}_{{{k}}}" if "ir" in symbol else rf"{symbol}_{{{k}}}"


def _direction_words(direction: Any) -> tuple[str, str]:
    import numpy as np

    e = np.asarray(direction, dtype=float)
    if np.count_nonzero(e) == 1 and e.max() == 1.0 and int(np.argmax(e)) < 3:
        k = int(np.argmax(e)) + 1
        return rf"$\varepsilon_{{{k}{k}}}$", rf"$\sigma_{{{k}{k}}}$"
    return r"$t$, $\varepsilon=t\,e$", r"$\sigma{:}e$"
