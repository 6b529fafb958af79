"""Yield points, solver residuals, energies, and the stiffness that a solver makes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..drawing import FAINT, INK, WALKED, canvas, colours, legend_below, styled, walked
from .identification import Identification
from .runs_info import Series

__all__ = ["energy_figure", "residual_figure", "yield_figure"]


@styled
def yield_figure(found: Identification) -> Any:
    """√J₂ against the mean pressure P_s of the sand: first legs, yield points, and the fitted lines."""
    figure, axes = canvas(1, 1, height=3.6)
    axis = axes[0, 0]
    levels = sorted({*found.fitted, *found.held_out})
    tints = colours(levels)
    top = 0.0
    for p in found.predictions:
        if p.linked and p.seed == found.seeds[0]:
            first = p.leg == 0
            axis.plot(
                p.mean_sand[first] / 1e3,
                p.q_sand[first] / np.sqrt(3.0) / 1e3,
                color=tints[p.pressure],
                label=f"{p.pressure / 1e3:g} kPa",
            )
            top = max(top, float(p.mean_sand[first].max()) / 1e3)
    y = found.pooled.yielding
    axis.plot(
        [y.mean_pressure_at_yield[level] / 1e3 for level in y.tau_y], [tau / 1e3 for tau in y.tau_y.values()], "o", color=INK,
        markersize=5, label=f"offset {found.options.yield_offset:.2%}",
    )  # fmt: skip
    x = np.array([0.0, top])
    lines = [("initial yield, staged", y.C_0, y.t, "-")]
    if found.pooled.hardening is not None:
        joint = found.pooled.hardening.joint.parameters
        lines.append(("initial yield, joint (the law)", joint.C_0, joint.t, "--"))
    if y.study_least_absolute is not None:
        lines.append(
            ("study's reading (confining P as abscissa)", y.study_least_absolute.C_0, y.study_least_absolute.slope, ":")
        )
    for name, cohesion, slope, style in lines:
        axis.plot(x, cohesion / 1e3 + slope * x, style, color=INK, linewidth=0.9, label=name)
    axis.set(xlabel=r"mean pressure of the sand $P_s$ [kPa]", ylabel=r"sand $\sqrt{J_2}=q_s/\sqrt{3}$ [kPa]")
    axis.set_xlim(left=0.0)
    axis.set_ylim(bottom=0.0)
    handles, labels = axis.get_legend_handles_labels()
    legend_below(figure, handles, labels, 3)
    return figure


_RESIDUALS = {
    "natural_map": "natural map, relative",
    "change": "impulse change of the last sweep, relative",
    "unbalanced": "unbalanced force / mean contact force",
}
_ENERGIES = {
    "external": "external work",
    "friction": "friction",
    "algorithmic": "implicit compliance",
    "shock": "shocks",
    "elastic": "elastic, change",
    "kinetic": "kinetic, change",
    "balance": "not accounted for",
}


@styled
def residual_figure(series: Sequence[Series]) -> Any:
    """Residuals of the solver along the tests, one panel per measure; links on solid, off dashed."""
    names = [n for n in _RESIDUALS if any(n in s.values for s in series)]
    figure, axes = canvas(len(names), 1, height=1.9, sharex=True)
    tints = colours(sorted({s.pressure for s in series}))
    for axis, name in zip(axes[:, 0], names, strict=True):
        for s in series:
            if name in s.values:
                data = np.maximum(np.asarray(s.values[name], float), 1e-16)
                x = walked(s.axial_strain)
                axis.semilogy(
                    x,
                    data,
                    "-" if s.linked else "--",
                    color=tints[s.pressure],
                    linewidth=0.8,
                    alpha=0.9 if s.linked else 0.5,
                )
        axis.set_title(_RESIDUALS[name])
    axes[-1, 0].set_xlabel(WALKED)
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=c) for c in tints.values()] + [Line2D([], [], color=INK, linestyle="--", alpha=0.5)]
    legend_below(figure, handles, [f"{level / 1e3:g} kPa" for level in tints] + ["beads unlinked"])
    return figure


@styled
def energy_figure(series: Series) -> Any:
    """Where the external work of one test went, and what is left over; energies from the start of the test."""
    figure, axes = canvas(1, 1, height=3.2)
    axis = axes[0, 0]
    shades = ("#222222", "#56B4E9", "#CC79A7", "#D55E00", "#0072B2", "#009E73", FAINT)
    values: Mapping[str, Any] = series.values
    largest = max(float(np.max(np.abs(values[name]))) for name in _ENERGIES if name in values)
    factor, unit = next(
        (f, u) for f, u in ((1.0, "J"), (1e3, "mJ"), (1e6, "µJ"), (1e9, "nJ")) if largest * f >= 1.0 or u == "nJ"
    )
    for (name, label), colour in zip(_ENERGIES.items(), shades, strict=True):
        if name not in values:
            continue
        data = np.asarray(values[name], float)
        data = data - data[0] if name in ("elastic", "kinetic") else data
        x = walked(series.axial_strain)
        axis.plot(x, factor * data, "--" if name == "balance" else "-", color=colour, linewidth=1.0, label=label)
    axis.axhline(0.0, color=FAINT, linewidth=0.5)
    axis.set(xlabel=WALKED, ylabel=f"energy [{unit}]")
    links = "links on" if series.linked else "beads unlinked"
    axis.set_title(f"seed {series.seed}, {series.pressure / 1e3:g} kPa, {links}")
    handles, labels = axis.get_legend_handles_labels()
    legend_below(figure, handles, labels)
    return figure
