"""Figures of laboratory tests: curves and stress paths, measured and by the law."""

from __future__ import annotations

from math import tan
from typing import Any

import numpy as np

from ..drawing import FAINT, INK, Signs, canvas, colours, legend_below, styled
from .laboratory_fit import LaboratoryFit, LaboratoryReplay

__all__ = ["curve_figure", "path_figure"]

#: Laws of the library whose virgin surface is √J₂ = C_0 + p tan θ_f.
CONES = ("drucker_prager", "drucker_prager_cap", "sand", "sand_k2")
_LAW: dict[str, Any] = {"color": INK, "linestyle": (0, (4, 2)), "linewidth": 1.0}
_HELD_OUT: dict[str, Any] = {"color": INK, "linestyle": (0, (1, 1.5)), "linewidth": 1.2}
_DATA: dict[str, Any] = {"linewidth": 2.6, "alpha": 0.55}


def _q(signs: Signs) -> str:
    formula = r"\sigma_r-\sigma_a" if signs.factor > 0 else r"\sigma_a-\sigma_r"
    return rf"deviator stress $q={formula}$ [kPa]"


def _law_style(replay: LaboratoryReplay) -> dict[str, Any]:
    return _HELD_OUT if replay.held_out else _LAW


def _legend(figure: Any, fit: LaboratoryFit, more: Any = ()) -> None:
    from matplotlib.lines import Line2D

    tints = colours(range(len(fit.replays)))
    handles, labels = [], []
    for k, replay in enumerate(fit.replays):
        water = "drained" if replay.test.drained else "undrained"
        handles.append(Line2D([], [], color=tints[k], **_DATA))
        labels.append(f"{replay.test.name}: {replay.test.pressure / 1e3:g} kPa, {water}")
    handles.append(Line2D([], [], **_LAW))
    labels.append("law, fitted")
    if any(replay.held_out for replay in fit.replays):
        handles.append(Line2D([], [], **_HELD_OUT))
        labels.append("law, predicted (held out)")
    for label, style in more:
        handles.append(Line2D([], [], **style))
        labels.append(label)
    legend_below(figure, handles, labels, 3)


@styled
def curve_figure(fit: LaboratoryFit, signs: Signs) -> Any:
    """q, and volume strain or pore pressure change, against the axial strain: measured (colour) and by the law (black)."""
    kinds = ["q"]
    kinds += ["volume"] if any(r.test.drained for r in fit.replays) else []
    kinds += ["pore"] if any(not r.test.drained for r in fit.replays) else []
    figure, axes = canvas((len(kinds) + 1) // 2, 2, height=3.1)
    flat = list(axes.flat)
    for spare in flat[len(kinds) :]:
        spare.set_visible(False)
    tints = colours(range(len(fit.replays)))
    for kind, axis in zip(kinds, flat, strict=False):
        axis.axhline(0.0, color=FAINT, linewidth=0.5)
        for k, replay in enumerate(fit.replays):
            test, run = replay.test, replay.run
            if kind != "q" and (kind == "volume") != test.drained:
                continue
            data, law = (test.q, run.q) if kind == "q" else (test.second, run.second)
            if kind == "volume":
                data, law = signs.percent(data), signs.percent(law)
            else:
                data, law = data / 1e3, law / 1e3
            x = signs.percent(test.axial_strain)
            axis.plot(x, data, color=tints[k], **_DATA)
            axis.plot(x, law, **_law_style(replay))
        label = {"q": _q(signs), "volume": signs.volume, "pore": r"pore pressure change $\Delta u$ [kPa]"}[kind]
        axis.set(xlabel=signs.axial.replace("{zz}", "{a}"), ylabel=label)
    _legend(figure, fit)
    return figure


@styled
def path_figure(fit: LaboratoryFit, signs: Signs) -> Any:
    """q against the effective mean pressure, with the first yield line where the law is such a cone."""
    figure, axes = canvas(1, 1, height=3.9)
    axis = axes[0, 0]
    tints = colours(range(len(fit.replays)))
    top = 0.0
    for k, replay in enumerate(fit.replays):
        test, run = replay.test, replay.run
        mean = test.pressure + test.q / 3.0 - (0.0 if test.drained else test.second)
        axis.plot(mean / 1e3, test.q / 1e3, color=tints[k], **_DATA)
        axis.plot(run.pressure / 1e3, run.q / 1e3, **_law_style(replay))
        top = max(top, float(mean.max()), float(run.pressure.max()))
    more = []
    if fit.law_name in CONES:
        x = np.array([0.0, top])
        q = np.sqrt(3.0) * (fit.values["C_0"] + x * tan(fit.values["theta_f"]))
        style: dict[str, Any] = {"color": FAINT, "linewidth": 1.0}
        axis.plot(x / 1e3, q / 1e3, **style)
        more = [(r"first yield, $q=\sqrt{3}\,(C_0+p\,\tan\theta_f)$", style)]
    axis.axhline(0.0, color=FAINT, linewidth=0.5)
    axis.set(
        xlabel=r"effective mean pressure $p=-\mathrm{tr}\,\sigma/3$ [kPa]"
        if signs.factor > 0
        else r"effective mean pressure $p$ [kPa]",
        ylabel=_q(signs) + "\n" + r"$|q|=\sqrt{3J_2}$",
    )
    axis.set_xlim(left=0.0)
    _legend(figure, fit, more)
    return figure
