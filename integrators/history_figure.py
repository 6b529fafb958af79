"""The figure of a path: stress against strain, the path of the stress, volume strain, and what was stored and dissipated.

Everything drawn is a column of the history; nothing is computed again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..drawing import BLUE, FAINT, GREEN, MEASURES, VERMILION, Signs, shown, styled, unit_scale
from ..errors import InputError

if TYPE_CHECKING:
    from .history import History

__all__ = ["COMPONENTS", "history_figure"]

Array = NDArray[np.float64]
COMPONENTS = ("11", "22", "33", "23", "13", "12")


@styled
def history_figure(history: History, *, component: str | None, measure: str, signs: str, title: str = "") -> Any:
    """The `matplotlib.figure.Figure` of a history; see `History.plot`, whose options these are."""
    from matplotlib.figure import Figure

    turned = Signs(signs)
    if measure not in MEASURES:
        raise InputError(f"measure = {measure!r} is unknown: use {' or '.join(map(repr, MEASURES))}")
    if component is not None and component not in COMPONENTS:
        raise InputError(f"component = {component!r} is unknown: use one of {', '.join(map(repr, COMPONENTS))}")
    if not len(history.eps):
        raise InputError("history: it has no rows, so that there is nothing to draw")
    k = _moving(history) if component is None else COMPONENTS.index(component)
    strain, stress = turned.percent(_plain(history.eps, k)), turned.factor * _plain(history.sig, k)
    word = ("extension +" if turned.factor > 0 else "compression +") if k < 3 else ""
    axis = rf"strain $\varepsilon_{{{COMPONENTS[k]}}}$ [%]" + (f" ({word})" if word else "")
    figure = Figure(figsize=(7.6, 5.8), layout="constrained")
    (curve, path), (volume, energy) = figure.subplots(2, 2)
    scale, unit = unit_scale(_largest(stress))
    _walk(curve, strain, scale * stress)
    curve.set(xlabel=axis, ylabel=rf"stress $\sigma_{{{COMPONENTS[k]}}}$ [{unit}]", title="Stress and strain")
    _stress_path(path, history.sig, measure, turned)
    _walk(volume, strain, turned.percent(history.eps[:, :3].sum(axis=1)))
    volume.set(xlabel=axis, ylabel=turned.volume, title="Volume strain")
    _energies(energy, history)
    if title:
        figure.suptitle(title, fontsize=10.0, fontweight="bold", x=0.01, ha="left")
    return shown(figure)


def _moving(history: History) -> int:
    """Component of the largest range of strain, of stress where the strain rests; the third of equals, as in a triaxial test."""
    for array in (history.eps, history.sig):
        ranges = np.array([np.ptp(np.concatenate([[0.0], _plain(array, k)])) for k in range(6)])
        if ranges.max() > 0.0:
            order = (2, 0, 1, 5, 4, 3)
            return next(k for k in order if ranges[k] >= (1.0 - 1e-9) * ranges.max())
    return 2


def _plain(array: Array, k: int) -> Array:
    """A component of the tensor itself: shear without the √2 of Mandel."""
    return array[:, k] if k < 3 else array[:, k] / np.sqrt(2.0)


def _largest(*arrays: Array) -> float:
    """The largest size that is finite."""
    sizes = np.abs(np.concatenate(arrays))
    return float(sizes[np.isfinite(sizes)].max(initial=0.0))


def _walk(ax: Any, x: Array, y: Array) -> None:
    """A curve with its beginning (open) and its end (filled)."""
    ax.axhline(0.0, color=FAINT, linewidth=0.8, zorder=1)
    ax.axvline(0.0, color=FAINT, linewidth=0.8, zorder=1)
    ax.plot(x, y, color=BLUE, zorder=2)
    ax.plot(x[0], y[0], "o", markersize=4.0, markerfacecolor="white", color=VERMILION, zorder=3)
    ax.plot(x[-1], y[-1], "o", markersize=4.0, color=VERMILION, zorder=3)


def _stress_path(ax: Any, sig: Array, measure: str, turned: Signs) -> None:
    size, name = MEASURES[measure]
    mean = sig[:, :3].mean(axis=1)
    deviator = sig.copy()
    deviator[:, :3] -= mean[:, None]
    equivalent = size * np.linalg.norm(deviator, axis=1) / np.sqrt(2.0)
    scale, unit = unit_scale(_largest(mean, equivalent))
    _walk(ax, scale * turned.factor * mean, scale * equivalent)
    label = r"mean stress $\mathrm{tr}\,\sigma/3$" if turned.factor > 0 else r"mean pressure $p=-\mathrm{tr}\,\sigma/3$"
    ax.set(xlabel=f"{label} [{unit}]", ylabel=f"equivalent stress {name} [{unit}]", title="Path of the stress")


def _energies(ax: Any, history: History) -> None:
    steps = np.diff(history.eps, axis=0, prepend=history.eps[:1])
    walked = 100.0 * np.cumsum(np.linalg.norm(steps, axis=1))
    stored, lost = np.asarray(history.psi), np.asarray(history.dissipation)
    scale, unit = unit_scale(_largest(stored, lost), "J/m³")
    ax.axhline(0.0, color=FAINT, linewidth=0.8, zorder=1)
    ax.plot(walked, scale * stored, color=GREEN, label=r"free energy $\rho\psi$")
    ax.plot(walked, scale * lost, color=VERMILION, linestyle="--", label="dissipated since the start")
    ax.set(
        xlabel=r"strain walked, $\int\Vert\mathrm{d}\varepsilon\Vert$ [%]", ylabel=f"energy [{unit}]", title="Energies"
    )
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.35 * (high - low))  # room for the legend above the curves
    ax.legend(loc="upper left")
