"""Estimates as rows of a table and as a figure: values with the intervals in which another sample is expected."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

from ..drawing import BLUE, FAINT, INK, VERMILION, styled

__all__ = ["HEADS", "estimate_figure", "estimate_rows"]

HEADS = ("parameter", "unit", "value", "interval")
WIDEST = 3.0  # half widths over the value that the axis shows; wider ones are arrows


def estimate_rows(estimates: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Name, unit, value and interval of every estimate; "none" where there is no interval."""
    rows = []
    for name, e in estimates.items():
        interval = f"{e.low:.4g} … {e.high:.4g}" if isfinite(e.low) and isfinite(e.high) else "none"
        rows.append((name, e.unit, f"{e.value:.6g}", interval))
    return rows


@styled
def estimate_figure(estimates: Mapping[str, Any]) -> Any:
    """Every estimate over its own value, one line each: the interval as a bar, the values of the single samples as rings.

    A value of zero has no such picture and stands as words; a bar that reaches beyond the axis ends in an arrow, a ring stands on its edge.
    """
    from matplotlib.figure import Figure

    shown = list(estimates.values())
    figure = Figure(figsize=(7.2, 0.9 + 0.34 * len(shown)), layout="constrained")
    axis = figure.subplots()
    reach = 0.1
    for e in shown:
        if e.value:
            ends = [abs(x / e.value - 1.0) for x in (e.low, e.high, *getattr(e, "seed_values", ())) if isfinite(x)]
            reach = max(reach, *ends) if ends else reach
    reach = min(1.1 * reach, WIDEST)
    for k, e in enumerate(shown):
        bounded = isfinite(e.low) and isfinite(e.high)
        if e.value and bounded:
            low, high = sorted((e.low / e.value, e.high / e.value))
            _bar(axis, k, low, high, reach)
        if e.value:
            single = [
                min(max(x / e.value, 1.0 - reach), 1.0 + reach) for x in getattr(e, "seed_values", ()) if isfinite(x)
            ]
            axis.plot(
                single, [k] * len(single), "o", markersize=5.0, markerfacecolor="none", color=VERMILION, clip_on=False
            )
            axis.plot(1.0, k, "o", markersize=4.0, color=INK)
        words = "" if bounded else "  no interval"
        axis.text(
            1.0 + 1.04 * reach, k, f"{e.value:.4g} {'' if e.unit == '1' else e.unit}{words}", va="center", fontsize=8.0
        )
    axis.axvline(1.0, color=FAINT, linewidth=0.8, zorder=1)
    axis.set_xlim(1.0 - reach, 1.0 + reach)
    axis.set_ylim(len(shown) - 0.5, -0.5)
    axis.set_yticks(range(len(shown)), [e.name for e in shown])
    axis.set_xlabel("over the identified value [–]")
    return figure


def _bar(axis: Any, k: int, low: float, high: float, reach: float) -> None:
    first, last = 1.0 - reach, 1.0 + reach
    ends = (min(max(low, first), last), min(max(high, first), last))
    axis.plot(ends, (k, k), color=BLUE, linewidth=2.0, solid_capstyle="butt", zorder=2)
    for end, bound in zip(ends, (low, high), strict=True):
        mark = "<" if bound < first else ">" if bound > last else "|"
        axis.plot(end, k, mark, markersize=6.0, color=BLUE, clip_on=False, zorder=3)
