"""Pictures of the cyclic test: the loops of the three models, every point of the sweep, one parameter at a time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..drawing import FAINT, INK, canvas, legend_below, styled
from .models import MODELS

__all__ = ["SHADES", "line_figure", "loop_figure", "sweep_figure"]

Array = NDArray[np.float64]

SHADES = {"sand": "#E69F00", "reinforced": "#D55E00", "texsol": "#0072B2"}
MARKS = {"sand": "o", "reinforced": "s", "texsol": "^"}
LABELS = {
    "ratio": r"$E_w/E_s$ [-]",
    "theta_f": r"$\theta_f$ [rad]",
    "H_k": r"$H_k$ [MPa]",
    "H_i": r"$H_i$ [MPa]",
    "stroke": r"$u/H$ [%]",
}
FACTORS = {"H_k": 1e-6, "H_i": 1e-6, "stroke": 100.0}
LATER = "#D55E00"


@styled
def loop_figure(sets: Mapping[str, Mapping[str, Any]]) -> Any:
    """A row per set of parameters, a column per model: the first loop, those between, and the last one with its point of zero force."""
    figure, axes = canvas(len(sets), len(MODELS), height=2.1, sharex="row", sharey="row")
    handles: list[Any] = []
    for row, (title, found) in zip(axes, sets.items(), strict=True):
        for one, model in zip(row, MODELS, strict=True):
            handles = _loops(one, found[model])
            one.axhline(0.0, color=FAINT, linewidth=0.6, zorder=1)
            one.axvline(0.0, color=FAINT, linewidth=0.6, zorder=1)
        row[0].set(ylabel="axial stress [kPa]")
        row[0].set_title(f"{title}\nsand")
        for one, model in zip(row[1:], list(MODELS)[1:], strict=True):
            one.set_title(f"\n{model}")
        row[1].set(xlabel="axial strain [%] (extension +)")
        row[0].locator_params(axis="x", nbins=4)
    legend_below(figure, handles, ["first loop", "loops between", "last loop", "zero force, last loop"], columns=4)
    return figure


def _loops(axes: Any, found: Mapping[str, Any]) -> list[Any]:
    strain, stress = 100.0 * found["strain"], found["stress"] / 1e3
    count = len(found["low"])
    per = (len(strain) - 1) // count
    (between,) = axes.plot(strain, stress, color="#b9b9b9", linewidth=0.4, zorder=2)
    (first,) = axes.plot(strain[: per + 1], stress[: per + 1], color="#D55E00", linewidth=1.0, zorder=3)
    (last,) = axes.plot(strain[-per - 1 :], stress[-per - 1 :], color="#0072B2", linewidth=1.6, zorder=4)
    (dot,) = axes.plot(
        100.0 * found["residual"][-1], 0.0, "o", color=INK, markersize=4, markeredgecolor="white", linestyle="none", zorder=5
    )  # fmt: skip
    return [first, between, last, dot]


@styled
def sweep_figure(axes_of: Mapping[str, Array], sooner: Array) -> Any:
    """Rows: θ_f, within it E_w/E_s; columns: H_i, within it the stroke, within it H_k. Colour: loops sooner than sand."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    n = len(axes_of["ratio"])
    table = sooner.transpose(1, 0, 3, 4, 2).reshape(n * n, n * n * n)
    gap = 0.6
    x = np.array([i + gap * (i // n) + gap * (i // (n * n)) for i in range(n**3)])
    y = np.array([j + gap * (j // n) for j in range(n * n)])
    figure, axes = canvas(1, 1, height=max(2.4, 0.19 * (n * n) + 1.9))
    one = axes[0, 0]
    norm = Normalize(-4.0, 15.0)
    shades = colormaps["Blues"]
    size = min(15.0, 280.0 / (n**3 + gap * n * n)) ** 2
    at_x, at_y = (a.reshape(-1) for a in np.meshgrid(x, y))
    flat = table.reshape(-1)
    sure, equal, later = flat > 0, flat == 0, flat < 0
    one.scatter(at_x[sure], at_y[sure], s=size, c=shades(norm(flat[sure])), edgecolors=FAINT, linewidths=0.4)
    handles = [
        one.scatter(at_x[chosen], at_y[chosen], s=0.4 * size, c="none", edgecolors=edge, linewidths=1.2)
        for chosen, edge in ((equal, "#b9b9b9"), (later, LATER))
    ]
    _ticks(one, axes_of, x, y, n)
    scale = ScalarMappable(Normalize(1.0, 15.0), _upper(shades, norm))
    bar = figure.colorbar(scale, ax=one, label="loops sooner than sand", shrink=0.9, aspect=14)
    bar.set_ticks([1, 5, 10, 15], labels=["1", "5", "10", "≥ 15"])
    legend_below(figure, handles, ["equal", "later"], columns=2)
    return figure


def _upper(shades: Any, norm: Any) -> Any:
    """The part of a colour map from one loop on."""
    from matplotlib.colors import ListedColormap

    return ListedColormap(shades(norm(np.linspace(1.0, 15.0, 64))))


def _value(name: str, x: float) -> str:
    return f"{FACTORS.get(name, 1.0) * x:.2g}"


def _ticks(one: Any, axes_of: Mapping[str, Array], x: Array, y: Array, n: int) -> None:
    one.set_yticks(y, [_value("ratio", r) for _ in range(n) for r in axes_of["ratio"]])
    one.set_xticks(
        x.reshape(-1, n).mean(axis=1), [_value("stroke", s) for _ in range(n) for s in axes_of["stroke"]], rotation=0 if n < 4 else 60
    )  # fmt: skip
    ends = f"{_value('H_k', axes_of['H_k'][0])} to {_value('H_k', axes_of['H_k'][-1])}"
    one.set(
        ylabel=LABELS["ratio"], xlabel=f"{LABELS['stroke']}; within a group from left to right {LABELS['H_k']} {ends}"
    )
    for k, value in enumerate(axes_of["H_i"]):
        centre = x.reshape(n, -1)[k].mean()
        one.annotate(
            f"{LABELS['H_i'].split(' ')[0]} = {_value('H_i', value)} MPa",
            (centre, y[-1] + 1.0),
            ha="center",
            va="center",
            fontsize=8,
        )
    for k, value in enumerate(axes_of["theta_f"]):
        centre = y.reshape(n, -1)[k].mean()
        one.annotate(
            rf"$\theta_f$ = {_value('theta_f', value)}",
            (x[-1] + 1.0, centre),
            va="center",
            fontsize=8,
            annotation_clip=False,
        )
    one.set(xlim=(x[0] - 1.0, x[-1] + 0.8), ylim=(y[0] - 0.8, y[-1] + 1.6))
    one.grid(False)
    one.tick_params(length=0)
    for side in one.spines.values():
        side.set_visible(False)


@styled
def line_figure(lines: Mapping[str, Mapping[str, Any]], criterion: int) -> Any:
    """Columns: the five parameters. Top: loops to stabilise; bottom: axial strain at zero force in the last loop."""
    figure, axes = canvas(2, len(lines), height=2.0, sharex="col", sharey="row")
    handles: list[Any] = []
    for (top, bottom), (name, found) in zip(axes.T, lines.items(), strict=True):
        along = FACTORS.get(name, 1.0) * found["along"]
        handles = []
        for k, model in enumerate(MODELS):
            style = {"color": SHADES[model], "marker": MARKS[model], "markersize": 3.5, "linewidth": 1.0}
            (line,) = top.plot(along, found["loops"][criterion, k], **style)
            bottom.plot(along, 100.0 * found["residual"][k], **style)
            handles.append(line)
        bottom.set_xscale("log")
        ends = [along[0], float(np.sqrt(along[0] * along[-1])), along[-1]]
        bottom.set_xticks(ends, [f"{e:.2g}" for e in ends])
        bottom.minorticks_off()
        bottom.set(xlabel=LABELS[name])
    axes[0, 0].set(ylabel="loops to stabilise")
    axes[1, 0].set(ylabel="strain at zero force [%]")
    legend_below(figure, handles, list(MODELS), columns=3)
    return figure
