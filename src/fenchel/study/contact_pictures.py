"""Pictures of the discrete method: sweeps and what is left of the error, the four laws of a link, buckling, motions in closed form."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..drawing import BLUE, FAINT, GREEN, INK, PURPLE, SKY, VERMILION, canvas, legend_below, styled

__all__ = [
    "buckling_figure", "convergence_figure", "laws_figure", "limit_figure", "motion_figure", "residual_figure", "sweeps_figure",
]  # fmt: skip

Array = NDArray[np.float64]
Results = Mapping[str, Any]


@styled
def convergence_figure(curves: Results) -> Any:
    """Natural map after each sweep, by problem."""
    figure, axes = canvas(1, 1, height=3.6)
    one = axes[0, 0]
    looks = {
        "packing, compliant": (BLUE, "-"), "packing, rigid": (VERMILION, "-"), "packing, rigid, no friction": (GREEN, "-"),
        "column of 20 spheres": (FAINT, "-"), "chain of 20 beads, rigid": (PURPLE, "-"),
        "chain of 20 beads, k = 10 k_c": (PURPLE, "--"),
    }  # fmt: skip
    for name, (colour, line) in looks.items():
        error = curves[name]
        shown = np.maximum.accumulate(error[::-1])[::-1] > 1e-14  # less is round-off
        width = 3.0 if name.startswith("column") else 1.2
        label = name.replace("k_c", "$k_c$").replace("k =", "$k$ =")
        one.plot(1 + np.flatnonzero(shown), error[shown], color=colour, linestyle=line, linewidth=width, label=label)
    one.set(xscale="log", yscale="log", xlim=(1, len(error)), ylim=(1e-13, 2.0))
    one.set(xlabel="sweeps [-]", ylabel=r"natural map $\|F\|/\|r\|$ [-]")
    one.legend(loc="lower left")
    return figure


def _powers(one: Any, x: Array, y: Array, colour: str, marker: str, label: str, spread: Array | None = None) -> None:
    one.plot(x, y, color=colour, marker=marker, markersize=4, label=label)
    if spread is not None:
        one.fill_between(x, spread.min(axis=1), spread.max(axis=1), color=colour, alpha=0.15, linewidth=0)


@styled
def sweeps_figure(bodies: Results, stiffness: Results) -> Any:
    """Sweeps against bodies (left) and against wire stiffness (right)."""
    figure, axes = canvas(1, 2, height=3.6, sharey=True)
    left, right = axes[0]
    rows, grains = bodies["rows"], bodies["grains"]
    _powers(left, rows, bodies["columns"], INK, "o", "column of rigid spheres")
    _powers(left, rows, bodies["chains"], PURPLE, "s", "hanging chain, rigid wire")
    _powers(left, grains, bodies["rigid"].mean(axis=1), VERMILION, "o", "packing, rigid grains", bodies["rigid"])
    _powers(left, grains, bodies["compliant"].mean(axis=1), BLUE, "o", "packing, compliant grains", bodies["compliant"])
    guide = np.array([rows[0], rows[-1]], dtype=float)
    left.plot(guide, 0.25 * bodies["columns"][0] * (guide / rows[0]) ** 2, color=FAINT, linestyle=":", label="slope 2")
    left.set(
        xscale="log",
        yscale="log",
        xlabel="bodies in the row, grains in the packing [-]",
        ylabel="sweeps of one step [-]",
    )
    k, ones = stiffness["ratios"], np.ones(len(stiffness["ratios"]))
    _powers(right, k, stiffness["chain"], PURPLE, "s", f"chain of {stiffness['beads']} beads, elastic wire")
    right.plot(k, stiffness["limit"] * ones, color=PURPLE, linestyle="--", label="the same, rigid wire")
    packed = stiffness["packings"]
    _powers(right, k, packed.mean(axis=1), BLUE, "o", f"packing of {stiffness['grains']} compliant grains", packed)
    guide = np.array([1.0, 1e3])
    right.plot(guide, 3.0 * guide, color=FAINT, linestyle=":", label="slope 1")
    right.set(xscale="log", xlabel=r"wire stiffness $k/k_c$ [-],  $k_c = l_0 m/(2h^2)$")
    for one in (left, right):
        one.set_ylim(2.0, 4e6)
        one.legend(loc="upper left", fontsize=7)
    return figure


@styled
def laws_figure(found: Results, stiffness: float, spread: float) -> Any:
    """Force against strain of single links, with the graphs of the laws."""
    figure, axes = canvas(2, 2, height=2.5, sharex=True, sharey=True)
    scale = stiffness * spread
    ends = np.array([-1.7, 1.7])
    graphs = {
        "rigid rod": (np.zeros(2), ends), "elastic rod": (ends, ends),
        "rigid wire": (np.array([-1.7, 0.0, 0.0]), np.array([0.0, 0.0, 1.7])),
        "elastic wire": (np.array([-1.7, 0.0, 1.7]), np.array([0.0, 0.0, 1.7])),
    }  # fmt: skip
    for one, name in zip(axes.ravel(), graphs, strict=True):
        x, y = graphs[name]
        strain, tension = found[name]["strain"] / spread, found[name]["tension"] / scale
        shown = (np.abs(tension) <= 1.75) & (np.abs(strain) <= 1.75)
        one.axhline(0.0, color=FAINT, linewidth=0.6)
        one.axvline(0.0, color=FAINT, linewidth=0.6)
        one.plot(x, y, color=VERMILION, linewidth=3.5, alpha=0.55, solid_capstyle="butt", label="graph of the law")
        one.plot(
            strain[shown],
            tension[shown],
            "o",
            color=BLUE,
            markersize=3,
            markeredgewidth=0,
            alpha=0.8,
            label="one step, random start",
        )
        one.set_title(f"{name}, $k$ = {stiffness:g} N" if name.startswith("elastic") else name)
        one.set(xlim=(-1.8, 1.8), ylim=(-1.8, 1.8))
    for one in axes[1]:
        one.set_xlabel(r"strain of the link $\varepsilon$ [%]")
    for one in axes[:, 0]:
        one.set_ylabel("tension $T$ [N]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    legend_below(figure, handles, labels)
    return figure


@styled
def limit_figure(limit: Results | None, fold: Results | None) -> Any:
    """Distance of elastic from rigid links against k (left), and what half a turn of a fold costs against the number of steps (right)."""
    figure, axes = canvas(1, 2, height=3.0)
    left, right = axes[0]
    if limit is not None:
        k = limit["ratios"]
        for name, colour, marker in (("rod", BLUE, "o"), ("wire", VERMILION, "s")):
            _powers(left, k, np.exp(np.log(limit[name]).mean(axis=1)), colour, marker, f"elastic {name}", limit[name])
        left.plot(k, 1.0 / k, color=FAINT, linestyle=":", label="slope −1")
        left.set(xscale="log", yscale="log", xlabel="$k/k_c$ [-]", ylabel=r"$\|T_k - T_{rigid}\|/\|T_{rigid}\|$ [-]")
        left.set_title("towards the rigid laws")
        left.legend()
    if fold is not None:
        n = fold["steps"].astype(float)
        right.plot(n, fold["rigid rod"], color=BLUE, marker="o", markersize=5, label="rigid rods")
        right.plot(
            n, fold["rigid wire"], color=VERMILION, marker="s", markersize=3, linestyle="none", label="rigid wires"
        )
        right.plot(n, 0.5 * fold["rigid rod"][0] * (n[0] / n) ** 2, color=FAINT, linestyle=":", label="slope −2")
        right.set(
            xscale="log", yscale="log", xlabel="steps for half a turn [-]", ylabel="share of kinetic energy lost [-]"
        )
        right.set_title("half of a chain folds over the other")
        right.set_xticks(n, [f"{m:.0f}" for m in n])
        right.minorticks_off()
        right.legend()
    return figure


@styled
def buckling_figure(found: Results) -> Any:
    """End force against the change of the distance of the ends, by number of points."""
    import matplotlib

    figure, axes = canvas(1, 2, height=3.0)
    shades = matplotlib.colormaps["viridis"](np.linspace(0.75, 0.1, len(found["counts"]) - 1))
    for place, count in enumerate(found["counts"]):
        shift, force = found[f"curve_{count}"]
        colour, line = (VERMILION, "--") if count == 2 else (shades[place - 1], "-")
        for one in axes[0]:
            one.plot(100.0 * shift, force, color=colour, linestyle=line, label=f"{count} points")
    for one in axes[0]:
        one.axhline(0.0, color=FAINT, linewidth=0.6)
        one.set_xlabel("change of the distance of the ends [%]")
    axes[0, 0].set(ylabel="force at the end [N] (tension +)", title="elastic rods, inner beads slightly off the axis")
    axes[0, 0].legend()
    axes[0, 1].set(xlim=(-1.0, 0.05), ylim=(-1.0, 0.1), title="compression, enlarged")
    return figure


@styled
def residual_figure(found: Results) -> Any:
    """Quantiles over contacts of the natural map against the tolerance of the sweeps."""
    figure, axes = canvas(1, 2, height=3.0, sharey=True)
    tolerance = found["tolerances"]
    for one, name in zip(axes[0], ("compliant", "rigid"), strict=True):
        for k, (label, colour) in enumerate((("median", BLUE), ("90 %", GREEN), ("99 %", VERMILION), ("largest", SKY))):
            one.plot(tolerance, found[name][:, k], color=colour, marker="o", markersize=3.5, label=label)
        one.plot(tolerance, found[f"total_{name}"], color=INK, linestyle="--", label=r"all, $\|F\|/\|r\|$")
        one.plot(tolerance, tolerance, color=FAINT, linestyle=":", label="equal to the tolerance")
        one.set(xscale="log", yscale="log", xlabel="tolerance of the sweeps [-]", title=f"{name} grains")
    axes[0, 0].set_ylabel("natural map / mean impulse [-]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    legend_below(figure, handles, labels, columns=6)
    return figure


@styled
def motion_figure(flight: Results, swing: Results, hung: Results) -> Any:
    """Bounces, tension of the pendulum, shape and tension of the hung chain."""
    figure, axes = canvas(2, 2, height=2.5)
    bounce, tension, shape, pull = axes.ravel()
    time = flight["interval"] * np.arange(flight["path"].shape[1])
    for e, path, colour in zip(flight["restitutions"], flight["path"], (INK, BLUE, VERMILION, GREEN), strict=False):
        bounce.plot(1e3 * time, 1e3 * path, color=colour, label=f"e = {e:g}")
    bounce.set(
        xlabel="time [ms]", ylabel="height above the floor [mm]", title="a ball let fall from 100 mm", ylim=(-3, 128)
    )
    bounce.legend(ncols=4, loc="upper center", fontsize=7, columnspacing=1.0, handlelength=1.2)
    angle, found = swing["path"]
    every = slice(2, None, max(1, len(angle) // 40))
    grid = np.linspace(-swing["start"], swing["start"], 200)
    exact = 3.0 * np.cos(grid) - 2.0 * np.cos(swing["start"])
    tension.plot(
        np.degrees(grid), exact, color=VERMILION, linewidth=3.5, alpha=0.55, label=r"$3\cos\varphi-2\cos\varphi_0$"
    )
    tension.plot(np.degrees(angle[every]), found[every], "o", color=BLUE, markersize=3, label="rigid rod")
    tension.set(xlabel=r"angle $\varphi$ [°]", ylabel=r"tension / weight [-]", title="pendulum let go at 57°")
    tension.legend(loc="lower center")
    x = hung["exact"]
    shape.plot(x[:, 0], x[:, 2], color=VERMILION, linewidth=3.5, alpha=0.55, label="statics of the links")
    pull.plot(1 + np.arange(len(hung["expected"])), hung["expected"], color=VERMILION, linewidth=3.5, alpha=0.55)
    for name, colour, marker, size in (("rod", BLUE, "o", 4.5), ("wire", INK, "x", 3.5)):
        part = hung[name]
        shape.plot(part["x"][:, 0], part["x"][:, 2], marker, color=colour, markersize=size, label=f"rigid {name}")
        pull.plot(1 + np.arange(len(part["tension"])), part["tension"], marker, color=colour, markersize=size)
    shape.set(xlabel="x [m]", ylabel="z [m]", title="chain of 20 links hung at two ends")
    shape.legend(loc="upper center")
    pull.set(xlabel="link [-]", ylabel="tension [N]", title="tension along the chain")
    return figure
