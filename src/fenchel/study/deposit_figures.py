"""Pictures of the deposits and of the active wire segments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dem.bodies import Assembly
from ..dem.measures import Network, Repose, active_length
from ..drawing import FAINT, canvas, colours, styled
from .active_segments import MULTIPLES, Segments

__all__ = ["box_view", "fabric_history", "heap_view", "length_figure", "profile_figure"]

Array = NDArray[np.float64]

SHADES = {"linked": "#0072B2", "unlinked": "#D55E00", "sand": "#E69F00"}


def _wires(axes: Any, network: Network, *, across: tuple[int, ...], scale: float = 1e3) -> Any:
    """Slack wires thin and grey, active links thick and coloured by tension over the mean; returns what a colour bar needs."""
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

    mean = active_length(network).mean_tension
    ratio = network.tension / mean if mean > 0.0 else np.zeros(len(network.tension))
    ends = scale * network.x[network.link][:, :, list(across)]
    weak, strong = ratio < 3.0, ratio >= 3.0
    shades = matplotlib.colormaps["viridis"]
    norm = Normalize(3.0, max(4.0, float(np.quantile(ratio[strong], 0.98)) if strong.any() else 4.0))
    kind = LineCollection
    if len(across) == 3:
        from mpl_toolkits.mplot3d.art3d import Line3DCollection

        kind = Line3DCollection
    axes.add_collection(kind(list(ends[weak]), colors="#b9b9b9", linewidths=0.35))
    order = np.argsort(ratio[strong])
    axes.add_collection(kind(list(ends[strong][order]), colors=shades(norm(ratio[strong][order])), linewidths=1.8))
    return ScalarMappable(norm, shades)


@styled
def heap_view(assembly: Assembly, network: Network) -> Any:
    """A section through the heap, and its wires from the side and from above."""
    from matplotlib.collections import EllipseCollection

    figure, axes = canvas(3, 1, height=2.3, gridspec_kw={"height_ratios": [1.0, 1.0, 2.2]})
    x, r = 1e3 * assembly.x, 1e3 * assembly.radius
    fixed = np.isinf(assembly.mass)
    centre = float(np.average(x[~fixed, 1]))
    section, side, above = axes[:, 0]
    distance = np.abs(x[:, 1] - centre)
    for chosen, face in (
        (fixed, "#c9c9c9"),
        (~fixed & (assembly.wire < 0), "#d9d2c3"),
        (assembly.wire >= 0, "#0072B2"),
    ):
        cut = chosen & (distance < r)
        width = 2.0 * np.sqrt(r[cut] ** 2 - distance[cut] ** 2)
        section.add_collection(
            EllipseCollection(
                width, width, np.zeros(len(width)), units="xy", offsets=x[cut][:, [0, 2]], offset_transform=section.transData,
                facecolors=face, edgecolors="#8f8676", linewidths=0.3,
            )
        )  # fmt: skip
    moving = x[~fixed]
    low, high = moving.min(axis=0) - 1.5, moving.max(axis=0) + 1.5
    shade = _wires(side, network, across=(0, 2))
    _wires(above, network, across=(0, 1))
    for one, second in ((section, 2), (side, 2), (above, 1)):
        one.set_xlim(low[0], high[0])
        one.set_ylim(-2.5 if second == 2 else low[1], high[second])
        one.set_aspect("equal")
        one.grid(False)
    section.set(ylabel="z [mm]", title="section through the middle (beads blue, floor grey)")
    side.set(ylabel="z [mm]", title="wires from the side")
    above.set(xlabel="x [mm]", ylabel="y [mm]", title="wires from above")
    figure.colorbar(shade, ax=[side, above], label="tension / mean tension", shrink=0.7)
    return figure


@styled
def box_view(network: Network) -> Any:
    """The wires of a triaxial sample in space and from the side."""
    figure, axes = canvas(1, 2, height=3.6)
    axes[0, 0].remove()
    space = figure.add_subplot(1, 2, 1, projection="3d")
    _wires(space, network, across=(0, 1, 2))
    half = 1e3 * network.half
    space.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]), zlim=(-half[2], half[2]))
    space.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
    space.set_box_aspect(tuple(half), zoom=0.85)
    space.tick_params(labelsize=7)
    side = axes[0, 1]
    shade = _wires(side, network, across=(0, 2))
    side.set(
        xlim=(-half[0], half[0]), ylim=(-half[2], half[2]), xlabel="x [mm]", ylabel="z [mm]", title="from the side"
    )
    side.set_aspect("equal")
    side.grid(False)
    figure.colorbar(shade, ax=side, label="tension / mean tension", shrink=0.8)
    return figure


@styled
def profile_figure(heaps: Mapping[str, Sequence[Repose | None]]) -> Any:
    """Free surfaces, mean over azimuths: thin by seed, thick their mean."""
    figure, axes = canvas(1, 1, height=3.0)
    one = axes[0, 0]
    for kind, found in heaps.items():
        there = [h for h in found if h is not None]
        if not there:
            continue
        most = max(float(h.distance[-1]) for h in there)
        grid = np.linspace(0.0, most, 60)
        rows = []
        for h in there:
            rows.append(np.interp(grid, h.distance, h.profile, right=0.0))
            one.plot(1e3 * h.distance, 1e3 * h.profile, color=SHADES[kind], linewidth=0.5, alpha=0.6)
        angle = np.mean([h.angle for h in there])
        one.plot(
            1e3 * grid, 1e3 * np.mean(rows, axis=0), color=SHADES[kind], linewidth=1.8, label=f"{kind}: {angle:.1f}°"
        )
    one.set(xlabel="distance from the axis [mm]", ylabel="height of the surface [mm]")
    one.legend()
    return figure


@styled
def fabric_history(histories: Sequence[Mapping[str, Array]], kinds: Mapping[str, Mapping[str, Array]]) -> Any:
    """Left: kinetic energy over the energy set free. Right: vertical share of the wire fabric, one line a seed."""
    figure, axes = canvas(1, 2)
    left, right = axes[0]
    for kind, history in kinds.items():
        rows = history["kinetic"] > 0.0
        left.semilogy(history["time"][rows], history["kinetic"][rows], color=SHADES[kind], label=kind)
    left.set(xlabel="time [s]", ylabel="kinetic energy / energy set free")
    left.legend()
    for history in histories:
        right.plot(history["time"], history["fabric_zz"], color=SHADES["linked"], linewidth=0.9)
    right.axhline(1.0 / 3.0, color=FAINT, linestyle="--", linewidth=0.9)
    right.annotate(
        "no preferred direction",
        (0.98, 1.0 / 3.0),
        xycoords=("axes fraction", "data"),
        ha="right",
        va="bottom",
        fontsize=8,
    )
    right.set(xlabel="time [s]", ylabel="vertical share of the wire fabric")
    return figure


@styled
def length_figure(slope: Sequence[Segments], test: Sequence[Segments]) -> Any:
    """Longest active piece and active share over m."""
    figure, axes = canvas(1, 2)
    left, right = axes[0]
    shades = list(colours([0.0, 1.0]).values())
    for found, name, shade in ((slope, "slope", shades[0]), (test, "triaxial", shades[1])):
        for s in found:
            left.plot(MULTIPLES, s.radii, color=shade, linewidth=0.5, alpha=0.6)
        mean = np.mean([s.radii for s in found], axis=0)
        left.plot(MULTIPLES, mean, color=shade, linewidth=1.8, label=name)
        null = float(np.mean([s.null_mean for s in found]))
        left.plot([2.4, 3.6], [null, null], color=shade, linestyle="--")
        right.plot(MULTIPLES, 100.0 * np.mean([s.share for s in found], axis=0), color=shade, linewidth=1.8, label=name)
    left.axvline(3.0, color=FAINT, linewidth=0.8)
    right.axvline(3.0, color=FAINT, linewidth=0.8)
    left.set_yscale("symlog", linthresh=1.0)
    left.set(xlabel="m [-]", ylabel="longest active piece [radii]", ylim=(0.0, None))
    right.set(xlabel="m [-]", ylabel="active share of the wire length [%]")
    left.legend()
    right.legend()
    return figure
