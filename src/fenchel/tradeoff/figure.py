"""The picture of a front: cost against error, what is dominated in grey, what a wanted accuracy costs read off the steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..drawing import FAINT, canvas, picture, styled
from ..front import ROUNDING, Front

__all__ = ["draw_fronts", "front_picture"]

_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8a6d3b", "#7f7f7f")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "*")


def _series(front: Front) -> str:
    """The part of a setting by which its points are told apart."""
    keys = {key for p in front.points for key in p.setting}
    return next((key for key in ("solver", "law", "step") if key in keys), next(iter(keys), ""))


def _value(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


@styled
def draw_fronts(fronts: Sequence[Front]) -> Any:
    """A figure with one pair of axes per front."""
    figure, axes = canvas(len(fronts), 1, height=3.4)
    for front, ax in zip(fronts, axes[:, 0], strict=True):
        _draw(front, ax)
    return figure


def _draw(front: Front, ax: Any) -> None:
    key = _series(front)
    inside = set(front.efficient)
    names = list(dict.fromkeys(_value(p.setting.get(key, "")) for p in front.points if p.error is not None))
    for k, name in enumerate(names):
        own = [
            (j, p) for j, p in enumerate(front.points) if p.error is not None and _value(p.setting.get(key, "")) == name
        ]
        colour, marker = _COLOURS[k % len(_COLOURS)], _MARKERS[k % len(_MARKERS)]
        for good in (False, True):
            chosen = [p for j, p in own if (j in inside) == good]
            ax.plot(
                [max(p.error or 0.0, ROUNDING) for p in chosen],
                [p.cost for p in chosen],
                marker,
                color=colour,
                markersize=6.0 if good else 4.5,
                markerfacecolor=colour if good else "none",
                alpha=1.0 if good else 0.55,
                linestyle="none",
                label=f"{key} {name}" if good or not any(j in inside for j, _ in own) else None,
            )
    steps = [front.points[j] for j in front.efficient]
    if steps:
        x = np.array([max(p.error or 0.0, ROUNDING) for p in steps])
        y = np.array([p.cost for p in steps])
        order = np.argsort(-x)
        ax.step(x[order], y[order], where="post", color=FAINT, linewidth=1.0, zorder=0)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.invert_xaxis()
    ax.set_xlabel(f"error: {front.measure}", wrap=True)
    ax.set_ylabel(f"cost [{front.cost}]")
    ax.set_title(f"{front.subject}: filled symbols are the front, hollow ones are dominated")
    handles, labels = ax.get_legend_handles_labels()
    kept = dict(zip(labels, handles, strict=True))
    ax.legend(kept.values(), kept.keys(), loc="center left", bbox_to_anchor=(1.0, 0.5))


def front_picture(fronts: Sequence[Front], kind: str = "svg") -> bytes:
    """The figure as SVG or PNG."""
    return picture(draw_fronts(fronts), kind)
