"""Pictures of the identification: the study's table, the cost surface, the replay."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..drawing import FAINT, canvas, styled, walked
from ..identify.yielding import least_absolute_line, least_squares_line
from .sizes import Size

__all__ = ["replay_figure", "surface_figure", "table_figure"]

Array = NDArray[np.float64]


@styled
def table_figure(table: Mapping[str, Array]) -> Any:
    """Yield stresses of the study with the published line, the two fits, and least squares without the last value."""
    figure, axes = canvas(1, 1, height=3.0)
    one = axes[0, 0]
    P, tau = table["P"], table["tau_y"]
    grid = np.array([4e4, 1e5])
    one.plot(P / 1e5, tau / 1e3, "o", color="#222222", label="Table 3 of the study")
    lines = (
        ("published: 0.079 rad, 2842 Pa", 2842.0, np.tan(0.079), "#0072B2", "-"),
        ("least absolute deviations", *_line(least_absolute_line(P, tau)), "#D55E00", "--"),
        ("least squares", *_line(least_squares_line(P, tau)), "#009E73", "-."),
        ("least squares without 0.9 bar", *_line(least_squares_line(P[:-1], tau[:-1])), FAINT, ":"),
    )
    for name, foot, slope, shade, style in lines:
        one.plot(grid / 1e5, (foot + slope * grid) / 1e3, color=shade, linestyle=style, label=name)
    one.set(xlabel="confining pressure [bar]", ylabel=r"yield stress $\tau_y=\sqrt{J_2}$ [kPa]")
    one.legend(fontsize=7)
    return figure


def _line(found: Any) -> tuple[float, float]:
    return found.C_0, found.slope


@styled
def surface_figure(surface: Mapping[str, Array]) -> Any:
    """Two contour maps of the logarithm of the misfit on one scale."""
    figure, axes = canvas(1, 2, height=3.0, sharey=True)
    x, y = surface["H_i"] / 1e6, surface["H_k"] / 1e6
    logs = {name: np.log10(np.maximum(surface[name], 1e-6)) for name in ("monotone", "reversal")}
    levels = np.linspace(-4.0, max(float(v.max()) for v in logs.values()), 13)
    filled = None
    middle = len(x) // 2
    for one, (name, title) in zip(
        axes[0], (("monotone", "shortening only"), ("reversal", "with a reversal into extension")), strict=True
    ):
        filled = one.contourf(x, y, np.maximum(logs[name], levels[0]), levels=levels, cmap="viridis")
        one.plot(x[middle], y[middle], "+", color="white", markersize=9, markeredgewidth=1.5)
        one.set(xlabel="H_i [MPa]", title=title)
        one.grid(False)
    axes[0, 0].set(ylabel="H_k [MPa]")
    figure.colorbar(filled, ax=axes[0, :], label="log10 of rms misfit of q / max |q|")
    return figure


@styled
def replay_figure(size: Size, folder: Path, identification: Mapping[str, Any]) -> Any:
    """q along the path of two tests."""
    from ..dem.run import load_record
    from ..identify.curves import curves
    from ..identify.parameters import LawParameters
    from ..identify.prediction import predict
    from ..identify.replay import replay
    from ..identify.tasks import Test
    from .identification_runs import identify_study

    law = LawParameters(**identification["law"])
    study = identify_study(size)
    levels = (size.pressures[0], size.held_out[0])
    figure, axes = canvas(1, 2, height=2.8, sharey=True)
    for one, p in zip(axes[0], levels, strict=True):
        test = curves(load_record(Test(study, 1, p, True, folder, "identify").run_file).history())
        found = predict(test, law, replay, seed=1, linked=True, held_out=p in size.held_out)
        along = walked(found.axial_strain)
        one.plot(along, found.q / 1e3, color="#8a8a8a", label="grains and wires")
        one.plot(along, found.q_law / 1e3, color="#0072B2", label="law")
        kind = "held out" if p in size.held_out else "fitted"
        one.set(xlabel="axial strain walked [%]", title=f"{p / 1e3:g} kPa, {kind}: {100 * found.error_q:.1f} % rms")
    axes[0, 0].set(ylabel=r"$q=\sigma_r-\sigma_z$ [kPa]")
    axes[0, 0].legend()
    return figure
