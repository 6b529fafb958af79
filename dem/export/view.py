"""A sample to turn with the mouse, by pyvista: the optional extra `fenchel[view]`."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError
from ..measures import Network
from .picture import colours_on_white
from .sample_panel import QUANTITIES, body_values, value_range

__all__ = ["view_sample"]


def _pyvista() -> Any:
    try:
        import pyvista  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError("view: needs pyvista, which is not installed; say `pip install fenchel[view]`") from None
    return pyvista


def view_sample(network: Network, *, quantity: str = "pressure", show: bool = True) -> Any:
    """Spheres coloured by a quantity of `QUANTITIES`, wires as tubes; returns the `pyvista.Plotter`.

    With `show` False the window is not opened: `plotter.screenshot("run.png")`, `plotter.export_html("run.html")` and whatever else pyvista
    does are still to come. Fixed bodies are grey; a plane sample lies in the plane z = 0. Raises `InputError` where pyvista is missing, for
    an unknown quantity, or without bodies.
    """
    values = body_values(network, quantity)
    if not len(network.x):
        raise InputError("view: the sample has no bodies")
    pyvista = _pyvista()
    centres = np.zeros((len(network.x), 3))
    centres[:, : network.dimension] = network.x
    linked = np.zeros(len(network.x), dtype=bool)
    linked[network.link.ravel()] = True
    free = ~network.fixed & ~linked
    plotter = pyvista.Plotter(off_screen=not show)
    ball = pyvista.Sphere(radius=1.0, theta_resolution=16, phi_resolution=16)
    if free.any():
        bottom, top, scale, unit = value_range(values[free], quantity)
        cloud = pyvista.PolyData(centres[free])
        label = f"{QUANTITIES[quantity][1]} [{unit}]"
        cloud["radius"], cloud[label] = network.radius[free], scale * values[free]
        plotter.add_mesh(
            cloud.glyph(scale="radius", geom=ball, orient=False),
            scalars=label,
            cmap=colours_on_white(),
            clim=(bottom, top),
            scalar_bar_args={
                "title": f"{label}\n ",  # else the title lies on the highest number
                "color": "black",
                "vertical": True,
                "position_x": 0.84,
                "position_y": 0.2,
                "height": 0.6,
                "title_font_size": 16,
                "label_font_size": 14,
                "fmt": "%.3g",
                "n_labels": 5,
            },
        )
    if network.fixed.any():
        held = pyvista.PolyData(centres[network.fixed])
        held["radius"] = network.radius[network.fixed]
        plotter.add_mesh(held.glyph(scale="radius", geom=ball, orient=False), color="lightgrey")
    if len(network.link):
        cells = np.column_stack([np.full(len(network.link), 2), network.link]).ravel()
        wires = pyvista.PolyData(centres, lines=cells)
        plotter.add_mesh(wires.tube(radius=0.25 * float(network.radius[linked].mean())), color="#D55E00")
    plotter.add_axes()
    if np.all(np.isfinite(network.half)):
        half = np.append(network.half, [] if network.dimension == 3 else [0.0])
        box = np.column_stack([-half, half]).ravel().tolist()
        plotter.add_mesh(pyvista.Box(bounds=box).extract_all_edges(), color="grey")
    plotter.set_background("white")
    if network.dimension == 2:
        plotter.view_xy()
    plotter.reset_camera()
    plotter.camera.zoom(0.8)  # room for the colour bar
    if show:
        plotter.show()
    return plotter
