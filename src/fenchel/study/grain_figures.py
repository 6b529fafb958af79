"""Pictures of the triaxial sweeps: wire stress and its slope against k, and the thin beads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..drawing import FAINT, INK, canvas, styled
from .statistics import Mean

__all__ = ["bead_figure", "macro_figure", "wire_stress_figure"]

Array = NDArray[np.float64]


@styled
def wire_stress_figure(elastic: Mapping[float, Any], rigid: Any) -> Any:
    """√J₂ of the links against axial shortening, as it is and its growth."""
    import matplotlib

    figure, axes = canvas(1, 2, height=3.0)
    shades = matplotlib.colormaps["viridis"](np.linspace(0.85, 0.1, len(elastic)))
    for one, less in zip(axes[0], (False, True), strict=True):
        for (k, c), shade in zip(elastic.items(), shades, strict=True):
            one.plot(100.0 * c.strain, c.growth if less else c.links, color=shade, label=f"k = {k:g} N")
        one.plot(
            100.0 * rigid.strain, rigid.growth if less else rigid.links, color=INK, linestyle="--", label="rigid wire"
        )
        one.set(xlabel="axial shortening [%]")
    axes[0, 0].set(ylabel=r"wire stress $\sqrt{J_2}$ [Pa]", title="from the preparation on")
    axes[0, 1].set(title="growth: of the stress less its start")
    axes[0, 1].legend(fontsize=7)
    return figure


@styled
def macro_figure(k: Array, slopes: Sequence[Mean], rigid: Mean, limit: tuple[float, float], critical: float) -> Any:
    """Slope against k with the fit, the rigid wire and k_c."""
    figure, axes = canvas(1, 1, height=3.0)
    one = axes[0, 0]
    values = np.array([m.value for m in slopes]) / 1e3
    half = np.array([m.half if np.isfinite(m.low) else 0.0 for m in slopes]) / 1e3
    one.errorbar(k, values, yerr=half, fmt="o", color="#0072B2", markersize=4, capsize=2, label="elastic wires")
    grid = np.geomspace(k[0] / 2, k[-1] * 4, 100)
    one.plot(
        grid,
        1e-3 / (1.0 / limit[0] + 1.0 / (limit[1] * grid)),
        color="#0072B2",
        linewidth=0.9,
        label="1/E = 1/E∞ + 1/(ηk)",
    )
    if np.isfinite(rigid.low):
        one.axhspan(rigid.low / 1e3, rigid.high / 1e3, color="#D55E00", alpha=0.2, linewidth=0)
    one.axhline(rigid.value / 1e3, color="#D55E00", label="rigid wire")
    one.axvline(critical, color=FAINT, linestyle=":", label="k_c")
    one.set_xscale("log")
    one.set(xlabel="wire stiffness k [N]", ylabel=r"slope of $\sqrt{J_2}$ (links) [kPa]", ylim=(0.0, None))
    one.legend()
    return figure


@styled
def bead_figure(found: Mapping[float, Sequence[Any]]) -> Any:
    """Mismatch with bootstrap bars, slip and sliding share against bead radius."""
    figure, axes = canvas(1, 3, height=2.8)
    ratios = np.array(list(found))
    mismatch, slip, share = axes[0]
    noise = float(np.mean([p.noise for ps in found.values() for p in ps]))
    for k in range(max(map(len, found.values()))):
        rows = [found[r][k] for r in ratios]
        value = np.array([p.mismatch for p in rows])
        low, high = np.array([p.low for p in rows]), np.array([p.high for p in rows])
        bars = np.clip(np.stack([value - low, high - value]), 0.0, None)
        mismatch.errorbar(
            ratios * (1 + 0.02 * k), value, yerr=bars, fmt="o", color="#0072B2", markersize=3, capsize=2, linewidth=0.8
        )
        slip.plot(ratios, [p.slip for p in rows], "o", color="#0072B2", markersize=3)
        share.plot(ratios, [100 * p.sliding for p in rows], "o", color="#0072B2", markersize=3)
    for one, name in ((slip, "slip"), (share, "sliding")):
        scale = 100.0 if name == "sliding" else 1.0
        one.plot(
            ratios,
            [scale * np.mean([getattr(p, name) for p in found[r]]) for r in ratios],
            color="#0072B2",
            linewidth=0.9,
        )
    mismatch.axhline(noise, color=FAINT, linestyle="--", linewidth=0.9, label="two halves of the grains")
    mismatch.legend(fontsize=7, loc="upper right")
    mismatch.set(ylabel=r"$\|\varepsilon_s-\varepsilon_w\|/\|\varepsilon_s\|$", ylim=(0.0, None))
    slip.set(ylabel="slip [mean grain radii]", ylim=(0.0, None))
    share.set(ylabel="sliding bead contacts [%]", ylim=(0.0, None))
    for one in axes[0]:
        one.axvline(2.0 / np.sqrt(3.0) - 1.0, color=FAINT, linestyle=":", linewidth=0.9)
        one.set(xlabel="bead radius / grain radius")
    return figure
