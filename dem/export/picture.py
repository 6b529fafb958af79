r"""Pictures of a sample: the contact-force network in a slice, the wire-tension network in projection.

The width of a line between two centres grows with the normal force, its colour too; wires are coloured by their tension, slack ones are
grey. The colours are cividis, which reads the same with colour-blind eyes.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...drawing import unit_scale
from ...errors import InputError
from ..measures import Network
from ..storage import replace_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["colours_on_white", "draw_networks", "write_image", "write_picture"]

Array = NDArray[np.float64]

_AXES = "xyz"
_FULL = 4.0  # forces above this many means are drawn alike


def draw_networks(network: Network, *, view: str = "xz", thickness: float | None = None) -> Figure:
    """A figure with the contact forces and, where there are links, the wire tensions, seen in the plane `view` ("xz", "xy", "yz").

    Contacts are those whose middle lies in a slice through the middle of the sample, `thickness` [m] thick (default: four mean radii);
    wires are seen through the whole depth. In two dimensions the view is the plane. Raises `InputError` for another view or without bodies.
    """
    from matplotlib.figure import Figure

    d = network.dimension
    axes = [0, 1] if d == 2 else [_AXES.index(a) for a in view if a in _AXES]
    if len(axes) != 2 or axes[0] == axes[1]:
        raise InputError(f'view = {view!r}: names two different axes, such as "xz"')
    if not len(network.x):
        raise InputError("picture: the sample has no bodies")
    depth = None if d == 2 else 3 - sum(axes)
    thickness = 4.0 * network.grain_radius if thickness is None else thickness
    linked = len(network.link) > 0
    # a floor may reach far beyond what lies on it
    seen = ~network.fixed if not network.fixed.all() else network.fixed
    low = (network.x[seen] - network.radius[seen, None]).min(axis=0)[axes]
    high = (network.x[seen] + network.radius[seen, None]).max(axis=0)[axes]
    margin = 0.02 * float((high - low).max()) + (2.0 * network.grain_radius if network.fixed.any() else 0.0)
    low, high = low - margin, high + margin
    factor, unit = unit_scale(float((high - low).max()), "m")
    count = 2 if linked else 1
    shape = float((high - low)[1] / (high - low)[0])
    wide = shape < 0.7
    width = 8.0 if wide else 3.9
    if wide:
        figure = Figure(figsize=(width + 1.6, count * (width * shape + 0.9)), layout="constrained")
    else:
        figure = Figure(figsize=(count * (width + 1.3), width * shape + 0.8), layout="constrained")
    grid = figure.subplots(count if wide else 1, 1 if wide else count, sharex=True, sharey=True, squeeze=False)
    panels: list[Any] = list(grid.ravel())
    # the thickest line is as wide as a mean grain
    thick = float(np.clip(72.0 * width / (high - low)[0] * network.grain_radius, 1.5, 5.0))
    _contacts(figure, panels[0], network, axes, depth, thickness, factor, thick)
    if linked:
        _wires(figure, panels[1], network, axes, factor, 0.5 * thick)
    where = "" if depth is None else f", slice of {factor * thickness:.3g} {unit}"
    panels[0].set_title(f"Contact forces{where}", fontsize=10)
    for panel in panels:
        panel.set_aspect("equal")
        panel.set_xlim(factor * low[0], factor * high[0])
        panel.set_ylim(factor * low[1], factor * high[1])
    for panel in panels[-1:] if wide else panels:
        panel.set_xlabel(f"{_AXES[axes[0]]} [{unit}]")
    for panel in panels if wide else panels[:1]:
        panel.set_ylabel(f"{_AXES[axes[1]]} [{unit}]")
    return figure


def colours_on_white() -> Any:
    """Cividis from ochre to dark blue: its bright yellow is lost on white."""
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("cividis_on_white", colormaps["cividis_r"](np.linspace(0.15, 1.0, 128)))


def _circles(
    panel: Any, network: Network, chosen: NDArray[np.bool_], axes: list[int], factor: float, **style: Any
) -> None:
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Circle

    patches = [
        Circle(tuple(factor * network.x[k, axes]), factor * float(network.radius[k])) for k in np.flatnonzero(chosen)
    ]
    panel.add_collection(PatchCollection(patches, **style))


def _contacts(
    figure: Any,
    panel: Any,
    network: Network,
    axes: list[int],
    depth: int | None,
    thickness: float,
    factor: float,
    thick: float,
) -> None:
    from matplotlib.collections import LineCollection

    bodies = np.ones(len(network.x), dtype=bool)
    near = np.ones(len(network.pair), dtype=bool)
    wall = np.isfinite(network.wall_normal).all(axis=1)
    if depth is not None:
        middle = 0.5 * (network.x[:, depth].min() + network.x[:, depth].max())
        off = np.abs(network.x[:, depth] - middle)
        bodies = off <= 0.5 * thickness
        near = np.abs(network.x[network.pair].mean(axis=1)[:, depth] - middle) <= 0.5 * thickness
        # a wall that the picture sees face on would be a dot
        wall &= bodies[network.wall[:, 0]] & (np.abs(np.nan_to_num(network.wall_normal[:, depth])) < 0.5)
    _circles(panel, network, bodies & ~network.is_bead, axes, factor, facecolor="0.93", edgecolor="0.75", linewidth=0.4)
    _circles(panel, network, bodies & network.is_bead, axes, factor, facecolor="0.8", edgecolor="0.6", linewidth=0.4)
    body = network.wall[wall, 0]
    ends = network.x[body] - network.radius[body, None] * network.wall_normal[wall]
    lines = np.concatenate([network.x[network.pair[near]], np.stack([network.x[body], ends], axis=1)])[:, :, axes]
    force = np.concatenate([network.normal_force[near], network.wall_force[wall]])
    if not len(force):
        return
    mean = float(network.normal_force.mean()) if len(network.pair) else float(force.mean())
    order = np.argsort(force)
    strength = np.minimum(force[order] / mean, _FULL) / _FULL
    scale, unit = unit_scale(mean, "N")
    drawn = LineCollection(
        list(factor * lines[order]),
        linewidths=0.3 + thick * strength,
        cmap=colours_on_white(),
        capstyle="round",
        zorder=3,
    )
    drawn.set_array(np.asarray(scale * force[order]))
    drawn.set_clim(0.0, scale * _FULL * mean)
    panel.add_collection(drawn)
    bar = figure.colorbar(drawn, ax=panel, extend="max", shrink=0.75, pad=0.02, aspect=15)
    bar.set_label(f"normal force [{unit}], mean {scale * mean:.3g}")


def _wires(figure: Any, panel: Any, network: Network, axes: list[int], factor: float, thick: float) -> None:
    from matplotlib.collections import LineCollection

    lines = factor * network.x[network.link][:, :, axes]
    taut = network.tension > 0.0
    panel.add_collection(LineCollection(list(lines[~taut]), colors="0.75", linewidths=0.3 * thick, capstyle="round"))
    share = float(network.link_length[taut].sum() / network.link_length.sum())
    panel.set_title(f"Wire tensions; {share:.0%} of the length taut, grey: slack", fontsize=10)
    if not taut.any():
        return
    tension = network.tension[taut]
    order = np.argsort(tension)
    top = float(np.quantile(tension, 0.99))
    scale, unit = unit_scale(top, "N")
    drawn = LineCollection(
        list(lines[taut][order]),
        linewidths=0.3 * thick + 0.7 * thick * np.minimum(tension[order] / top, 1.0),
        cmap=colours_on_white(),
        capstyle="round",
    )
    drawn.set_array(np.asarray(scale * tension[order]))
    drawn.set_clim(0.0, scale * top)
    panel.add_collection(drawn)
    bar = figure.colorbar(drawn, ax=panel, extend="max", shrink=0.75, pad=0.02, aspect=15)
    bar.set_label(f"wire tension [{unit}]")


def write_picture(network: Network, path: Path | str, *, view: str = "xz", thickness: float | None = None) -> Path:
    """Save `draw_networks` to a file; its ending says the format (png, svg, pdf). `InputError` for one that matplotlib does not know."""
    return write_image(draw_networks(network, view=view, thickness=thickness), path)


def write_image(figure: Figure, path: Path | str) -> Path:
    """Save a figure to a file, which is replaced as a whole; equal figures give equal files.

    The ending says the format (png, svg, pdf): `InputError` for one that matplotlib does not know, `StorageError` where it cannot be
    written.
    """
    import io

    path = Path(path)
    image = io.BytesIO()
    kind = path.suffix.lstrip(".").lower()
    known = figure.canvas.get_supported_filetypes()
    if kind not in known:
        raise InputError(f"{path}: pictures are written as {', '.join(sorted(known))}; choose one of these endings")
    # without a date, so that equal states give equal files
    extra: dict[str, Any] = {"metadata": {"Date": None}} if kind == "svg" else {"dpi": 200} if kind == "png" else {}
    figure.savefig(image, format=kind, **extra)
    replace_file(path, image.getvalue())
    return path
