"""Pictures of the choice of a formulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..drawing import INK, canvas, colours, styled
from .cost_functions import COSTS, NAMES

__all__ = ["grains_figure", "planted_figure"]

SIGNS = {"t": r"$\tan\theta_f$", "C_0": "$C_0$", "H_k": "$H_k$", "H_i": "$H_i$"}

Values = Mapping[str, Sequence[float]]


def _bars(axes: Any, heights: Values, names: Sequence[str], spread: Values | None = None) -> Any:
    """Groups of bars, one of each cost."""
    shades = colours(range(len(COSTS)))
    drawn = []
    for k, cost in enumerate(COSTS):
        place = np.arange(len(names)) + 0.2 * (k - 1.5)
        thin = {"yerr": spread[cost], "capsize": 2.0, "error_kw": {"elinewidth": 0.8}} if spread else {}
        drawn.append(axes.bar(place, heights[cost], 0.18, color=shades[k], **thin))
    axes.set_xticks(range(len(names)), names)
    return drawn


@styled
def planted_figure(sets: Mapping[str, Mapping[str, Any]], titles: Mapping[str, str]) -> Any:
    """Per set: relative errors by cost (seeds, unknowns), and two condition numbers, E_s fixed and free."""
    figure, axes = canvas(len(sets), 2, gridspec_kw={"width_ratios": [2.2, 1.0]})
    drawn: Any = []
    for (errors, numbers), (name, found) in zip(axes, sets.items(), strict=True):
        mean = {cost: 100.0 * np.nanmean(found[cost]["error"], axis=0) for cost in COSTS}
        spread = {cost: 100.0 * np.nanstd(found[cost]["error"], axis=0, ddof=1) for cost in COSTS}
        drawn = _bars(errors, mean, [SIGNS[n] for n in NAMES], spread)
        errors.axhline(0.0, color=INK, linewidth=0.6)
        errors.set(ylabel="found / planted − 1 [%]", title=f"parameters {name}")
        _bars(numbers, {cost: found[cost]["condition"] for cost in COSTS}, ("$E_s$ fixed", "$E_s$ free"))
        numbers.set(ylabel="condition number [1]", title="scaled Jacobian")
    figure.legend(drawn, [titles[c] for c in COSTS], loc="outside lower center", ncols=2)
    return figure


@styled
def grains_figure(found: Mapping[str, Any], titles: Mapping[str, str]) -> Any:
    """Every fit measured by every cost, on the tests fitted and on what was left out."""
    figure, axes = canvas(1, 2, height=3.0, sharey=True)
    drawn: Any = []
    views = {"measured": "tests fitted", "measured left out": f"left out: {found['left out']}"}
    for place, (key, title) in zip(axes[0], views.items(), strict=True):
        heights = {c: [100.0 * found[c][key][m] for m in COSTS] for c in COSTS}
        drawn = _bars(place, heights, ["axial\nstrain", "whole\nstrain", "stress", "gap"])
        place.set(xlabel="measured by the cost", title=title)
    axes[0, 0].set_ylabel("misfit, rms [% of the largest]")
    figure.legend(drawn, [f"fitted by: {titles[c]}" for c in COSTS], loc="outside lower center", ncols=2)
    return figure
