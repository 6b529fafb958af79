"""Figures of part C: the cone beside the hexagon, and the error of a step under its gap."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..drawing import canvas, colours, legend_below, styled
from .model_sand import ANGLES, COHESION, PRESSURE, READINGS, hexagon_radius

__all__ = ["cone_figure", "gap_figure"]

WORDS = {"compression": "compressive edges", "extension": "extensive edges", "plane_strain": "plane strain"}


@styled
def cone_figure(found: Mapping[str, Any]) -> Any:
    """Deviatoric plane at the largest friction angle, and radius of the cone over that of the hexagon."""
    figure, axes = canvas(1, 2, height=3.3)
    shades = dict(zip(READINGS, colours(range(len(READINGS))).values(), strict=True))
    plane, ratio = axes[0]
    angle, phi = np.asarray(found["angle"]), max(ANGLES)
    hexagon = hexagon_radius(phi, COHESION, PRESSURE, angle) / 1e3
    plane.plot(hexagon * np.sin(angle), -hexagon * np.cos(angle), color="#222222", label="Mohr–Coulomb")
    for reading in READINGS:
        r = hexagon * np.asarray(found["ratio"][f"{phi:g}"][reading])
        plane.plot(r * np.sin(angle), -r * np.cos(angle), color=shades[reading], label=WORDS[reading])
    plane.set_aspect("equal")
    plane.set_xlabel(r"$(\sigma_1-\sigma_2)/\sqrt{2}$ [kPa]")
    plane.set_ylabel(r"$(2\sigma_3-\sigma_1-\sigma_2)/\sqrt{6}$ [kPa]")
    part = angle <= np.pi / 3 + 1e-9
    for line, phi in zip((":", "--", "-"), ANGLES, strict=True):
        for reading in READINGS:
            values = np.asarray(found["ratio"][f"{phi:g}"][reading])
            ratio.plot(np.degrees(angle[part]), values[part], line, color=shades[reading])
        ratio.plot([], [], line, color="#8a8a8a", label=rf"$\phi$ = {phi:g} rad")
    ratio.axhline(1.0, color="#222222", linewidth=0.8)
    ratio.set_xlabel("Lode angle from triaxial compression [°]")
    ratio.set_ylabel("radius over Mohr–Coulomb's [-]")
    ratio.legend()
    legend_below(figure, *plane.get_legend_handles_labels(), columns=4)
    return figure


@styled
def gap_figure(found: Mapping[str, Any]) -> Any:
    """Error of a pair against its gap, logarithmic."""
    figure, axes = canvas(1, 1, height=3.0)
    axis, pairs = axes[0, 0], found["pairs"]
    gap, error = np.asarray(pairs["gap"]), np.asarray(pairs["error"])
    keep = (gap > 0) & (error > 0)
    axis.loglog(gap[keep], error[keep], ".", markersize=3, color=colours([0])[0])
    ends = np.array([gap[keep].min(), gap[keep].max()])
    axis.loglog(ends, ends, color="#222222", linewidth=0.8, label="error = gap")
    axis.set_xlabel("gap between primal and dual [J/m³]")
    axis.set_ylabel("error of both in the energy norm [J/m³]")
    axis.legend()
    return figure
