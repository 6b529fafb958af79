"""Exports of a sample: VTK for ParaView, extended XYZ for OVITO, pictures; from a run file or from a live simulation.

A run file as a whole, with its figure and its view, is `fenchel.dem.read_run`.
"""

from .extended_xyz import write_extended_xyz
from .picture import draw_networks, write_picture
from .runs import Export, export_run, network_of_run
from .vtk import VtkSeries, write_vtk

__all__ = [
    "Export",
    "VtkSeries",
    "draw_networks",
    "export_run",
    "network_of_run",
    "write_extended_xyz",
    "write_picture",
    "write_vtk",
]
