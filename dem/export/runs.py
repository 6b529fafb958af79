"""From a run file to a network, and to every kind of export."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from ...errors import InputError
from ..bodies import Assembly
from ..measures import Network
from ..storage import load_run
from .extended_xyz import write_extended_xyz
from .picture import write_picture
from .vtk import write_vtk

__all__ = ["Export", "export_run", "network_of_run"]

Export = Literal["vtk", "xyz", "picture"]


def network_of_run(path: Path | str) -> Network:
    """The network of the last state in a run file, finished or not; `InputError` where there is none.

    Coefficients of friction are those of the scene: exact in the test, not during a compaction with another one.
    """
    content, settings = load_run(path)
    if "assembly" not in content:
        raise InputError(f"{path}: holds no sample, only results; exports need the run file of a scene")
    scene = settings.get("scene", settings)
    # a test says the friction with its grains and wires, a motion with its contact law
    contact = scene.get("contact") or {}
    friction = float(contact.get("friction", (scene.get("grains") or {}).get("friction", float("nan"))))
    bead_friction = contact.get("bead_friction", (scene.get("wires") or {}).get("friction"))
    return Network.of_assembly(
        Assembly.from_arrays(content["assembly"]),
        friction=friction,
        bead_friction=None if bead_friction is None else float(bead_friction),
    )


def export_run(path: Path | str, kind: Export) -> list[Path]:
    """Export the last state of `RUN.h5` beside it: `RUN.bodies.vtp` and so on, `RUN.xyz`, or `RUN.png`; returns the files."""
    network = network_of_run(path)
    stem = Path(path).with_suffix("")
    if kind == "vtk":
        return write_vtk(network, stem)
    if kind == "xyz":
        return [write_extended_xyz(network, f"{stem}.xyz")]
    if kind == "picture":
        return [write_picture(network, f"{stem}.png")]
    raise InputError(f"export = {kind!r}: is one of vtk, xyz, picture")
