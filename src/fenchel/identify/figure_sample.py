"""The sample: a slice through the grains, and the wire chains in space."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..drawing import FAINT, INK, canvas, styled
from .runs_info import SampleView

__all__ = ["sample_figure"]


@styled
def sample_figure(view: SampleView) -> Any:
    """Left: grains and beads cut by the mid plane y = const (true section circles). Right: the wires seen in space."""
    import matplotlib
    from matplotlib.collections import EllipseCollection

    figure, axes = canvas(1, 2, height=3.7)
    x = 1e3 * np.asarray(view.positions)
    r = 1e3 * np.asarray(view.radii)
    wire = np.asarray(view.wire)
    middle = 0.5 * (x.min(axis=0) + x.max(axis=0))
    left = axes[0, 0]
    distance = np.abs(x[:, 1] - middle[1])
    for chosen, face, edge in ((wire < 0, "#d9d2c3", "#8f8676"), (wire >= 0, "#0072B2", "#12486f")):
        cut = chosen & (distance < r)
        width = 2.0 * np.sqrt(r[cut] ** 2 - distance[cut] ** 2)
        discs = EllipseCollection(
            width,
            width,
            np.zeros(len(width)),
            units="xy",
            offsets=x[cut][:, [0, 2]],
            offset_transform=left.transData,
            facecolors=face,
            edgecolors=edge,
            linewidths=0.4,
        )
        left.add_collection(discs)
    margin = float(r.max())
    left.set_xlim(x[:, 0].min() - margin, x[:, 0].max() + margin)
    left.set_ylim(x[:, 2].min() - margin, x[:, 2].max() + margin)
    left.set_aspect("equal")
    left.grid(False)
    left.set(xlabel="x [mm]", ylabel="z [mm]", title="section at mid depth (beads blue)")
    axes[0, 1].remove()
    right = figure.add_subplot(1, 2, 2, projection="3d")
    shades = matplotlib.colormaps["viridis"]
    chains = [k for k in np.unique(wire) if k >= 0]
    for k in chains:
        chain = x[wire == k]
        right.plot(*chain.T, color=shades(0.1 + 0.75 * (k % 17) / 16), linewidth=0.8)
    if not chains:
        right.scatter(*x.T, s=2, color=FAINT)
    right.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
    right.set_title(f"{len(chains)} wires" if chains else "no wires", color=INK)
    right.set_box_aspect(np.ptp(x, axis=0), zoom=0.85)
    right.tick_params(labelsize=7)
    if view.title:
        figure.suptitle(view.title, x=0.01, ha="left", fontsize=9)
    return figure
