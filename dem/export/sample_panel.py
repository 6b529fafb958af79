r"""The sample in one panel: bodies as circles coloured by a quantity, wires as lines as wide as they are taut.

In space the panel shows a slice through the middle, far bodies first: each body whose centre lies in the slice is drawn whole, as its
projection. What can be shown is in `QUANTITIES`. The pressure of a body is that of its mean stress under contact forces,

    p = −tr σ/d,   σ = (1/V) Σ f ⊗ (c − x),   hence   p = (r/(d V)) Σ f_n

(f_n: normal forces at the contacts c, walls counted, links not; V = 4πr³/3, in the plane πr² per unit thickness).

Mean stress of a body: Love (1927), A Treatise on the Mathematical Theory of Elasticity, art. 123.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...drawing import unit_scale
from ...errors import InputError
from ..measures import Network
from .picture import colours_on_white

__all__ = [
    "FLAT",
    "QUANTITIES",
    "body_values",
    "draw_sample",
    "seen_shape",
    "value_range",
    "view_axes",
]

Array = NDArray[np.float64]

QUANTITIES = {  # unit and meaning of what a body can be coloured by
    "pressure": ("Pa", "pressure of a body"),
    "contacts": ("1", "contacts of a body"),
    "speed": ("m/s", "speed of a body"),
    "radius": ("m", "radius of a body"),
}

FLAT = 0.6  # height over width below which a sample lies flat

_AXES = "xyz"


def view_axes(network: Network, view: str) -> list[int]:
    """The two axes of a view ("xz", "xy", ...); those of the plane for a plane sample. `InputError` for another word."""
    if network.dimension == 2:
        return [0, 1]
    axes = [_AXES.index(letter) for letter in view if letter in _AXES]
    if len(view) != 2 or len(axes) != 2 or axes[0] == axes[1]:
        raise InputError(f'view = {view!r}: names two different axes, such as "xz"')
    return axes


def body_values(network: Network, quantity: str) -> Array:
    """A quantity of `QUANTITIES` for every body, shape (body_count,), in its SI unit; `InputError` for another name.

    In the plane a pressure is a force per length of boundary and per metre of thickness [Pa].
    """
    count, d = network.x.shape
    if quantity == "radius":
        return network.radius.copy()
    if quantity == "speed":
        return np.linalg.norm(network.velocity, axis=1)
    ends = np.concatenate([network.pair.ravel(), network.wall[:, 0]])
    if quantity == "contacts":
        return np.bincount(ends, minlength=count).astype(np.float64)
    if quantity == "pressure":
        force = np.bincount(ends, np.concatenate([np.repeat(network.normal_force, 2), network.wall_force]), count)
        r = network.radius
        volume = 4.0 / 3.0 * np.pi * r**3 if d == 3 else np.pi * r**2
        return r * force / (d * volume)
    raise InputError(f"quantity = {quantity!r}: is one of {', '.join(QUANTITIES)}")


def _extent(network: Network) -> tuple[Array, Array]:
    """Corners of what can move, shape (d,) each [m]: a floor may reach far beyond what lies on it."""
    seen = ~network.fixed if not network.fixed.all() else network.fixed
    low = (network.x[seen] - network.radius[seen, None]).min(axis=0)
    return low, (network.x[seen] + network.radius[seen, None]).max(axis=0)


def seen_shape(network: Network, view: str) -> float:
    """Height over width of the sample in a view [-]; 1 without bodies."""
    axes = view_axes(network, view)
    if not len(network.x):
        return 1.0
    low, high = _extent(network)
    size = (high - low)[axes]
    return float(size[1] / size[0])


def value_range(values: Array, quantity: str) -> tuple[float, float, float, str]:
    """Where the colours of a quantity begin and end, in the multiple of its unit that reads best, the factor to it, and its name.

    They begin at nothing (radii: at the smallest), and end at what only one in fifty exceeds.
    """
    unit, _ = QUANTITIES[quantity]
    top = float(np.quantile(values, 0.98))
    bottom = float(values.min()) if quantity == "radius" else 0.0
    scale, name = (1.0, "–") if unit == "1" else unit_scale(top, unit)
    if not top > bottom * (1.0 + 1e-9):  # all alike: one colour
        bottom, top = (0.0, top) if top > 0.0 else (0.0, 1.0 / scale)
    return scale * bottom, scale * top, scale, name


def draw_sample(
    figure: Any,
    panel: Any,
    network: Network,
    *,
    view: str = "xz",
    quantity: str = "pressure",
    thickness: float | None = None,
) -> None:
    """Draw the sample into a panel of a figure, with a colour bar beside it.

    The slice is `thickness` [m] thick (default: four mean radii). Raises `InputError` for an unknown view or quantity or without bodies.
    """
    axes = view_axes(network, view)
    if not len(network.x):
        raise InputError("plot: the sample has no bodies")
    values = body_values(network, quantity)
    depth = None if network.dimension == 2 else 3 - sum(axes)
    thickness = 4.0 * network.grain_radius if thickness is None else thickness
    if not thickness > 0.0:
        raise InputError(f"thickness = {thickness:g}: must be positive, in metres")
    low, high = _extent(network)
    shown = np.ones(len(network.x), dtype=bool)
    links = np.ones(len(network.link), dtype=bool)
    if depth is not None:
        middle = 0.5 * (low[depth] + high[depth])
        shown = np.abs(network.x[:, depth] - middle) <= 0.5 * thickness
        # a bead of a wire is drawn by its wire: the whole of it where its link lies in the slice
        links = np.abs(network.x[network.link].mean(axis=1)[:, depth] - middle) <= 0.5 * thickness
    low, high = low[axes], high[axes]
    margin = 0.03 * float((high - low).max()) + (2.0 * network.grain_radius if network.fixed.any() else 0.0)
    low, high = low - margin, high + margin
    factor, unit = unit_scale(float((high - low).max()), "m")
    linked = np.zeros(len(network.x), dtype=bool)
    linked[network.link.ravel()] = True
    # whoever sees the first axis to the right and the second one up looks against their vector product: what is far comes first
    near = 1.0 if (axes[1] - axes[0]) % 3 == 1 else -1.0
    order = np.arange(len(network.x)) if depth is None else np.argsort(near * network.x[:, depth], kind="stable")
    order = order[shown[order]]
    loose, held = order[~network.fixed[order] & ~linked[order]], order[network.fixed[order]]
    if len(held):
        _circles(panel, network, held, axes, factor, facecolor="0.85", edgecolor="0.6")
    if len(loose):
        side = "bottom" if seen_shape(network, view) < FLAT else "right"
        bar = _coloured(figure, panel, network, loose, values, quantity, axes, factor, side)
        bar.ax.tick_params(labelsize=8)
    width = 72.0 * 4.0 / float((high - low).max()) * network.grain_radius  # a mean radius in points, about
    _wires(panel, factor * network.x[network.link[links]][:, :, axes], network.tension[links], width)
    panel.set_aspect("equal")
    panel.set_xlim(factor * low[0], factor * high[0])
    panel.set_ylim(factor * low[1], factor * high[1])
    panel.set_xlabel(f"{_AXES[axes[0]]} [{unit}]")
    panel.set_ylabel(f"{_AXES[axes[1]]} [{unit}]")
    said = [] if depth is None else [f"slice of {factor * thickness:.3g} {unit}"]
    said += ["lines: wires, thick: taut"] if links.any() else []
    panel.set_title("; ".join(said), fontsize=9)


def _circles(
    panel: Any, network: Network, chosen: NDArray[np.int64], axes: list[int], factor: float, **style: Any
) -> Any:
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Circle

    patches = [Circle(tuple(factor * network.x[k, axes]), factor * float(network.radius[k])) for k in chosen]
    drawn = PatchCollection(patches, linewidth=0.3, **style)
    panel.add_collection(drawn)
    return drawn


def _coloured(
    figure: Any,
    panel: Any,
    network: Network,
    chosen: NDArray[np.int64],
    values: Array,
    quantity: str,
    axes: list[int],
    factor: float,
    side: str,
) -> Any:
    """The bodies that can move, with their colour bar."""
    bottom, top, scale, unit = value_range(values[chosen], quantity)
    drawn = _circles(panel, network, chosen, axes, factor, cmap=colours_on_white(), edgecolor="0.25")
    drawn.set_array(scale * values[chosen])
    drawn.set_clim(bottom, top)
    above = "max" if scale * values[chosen].max() > top * (1.0 + 1e-9) else "neither"
    bar = figure.colorbar(drawn, ax=panel, extend=above, shrink=0.8, pad=0.02, aspect=25, location=side)
    bar.set_label(f"{QUANTITIES[quantity][1]} [{unit}]", fontsize=9)
    if quantity == "contacts":
        bar.locator.set_params(integer=True)
        bar.update_ticks()
    return bar


def _wires(panel: Any, lines: Array, tension: Array, width: float) -> None:
    """Black on a white rim, so that they stand out from any colour: slack links thin, taut ones thicker with their tension."""
    from matplotlib.collections import LineCollection

    if not len(lines):
        return
    top = float(np.quantile(np.abs(tension), 0.98)) or 1.0
    thick = np.clip(width, 1.2, 4.0) * (0.3 + 0.7 * np.clip(np.abs(tension) / top, 0.0, 1.0))
    for colour, wider in (("white", 1.2), ("black", 0.0)):
        panel.add_collection(
            LineCollection(list(lines), colors=colour, linewidths=thick + wider, capstyle="round", zorder=3)
        )
