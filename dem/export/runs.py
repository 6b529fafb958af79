"""A run file as it is read: its record, its last state, a figure of it, a view of it, and every kind of export."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ...errors import InputError
from ...notebook import Summary, field_cells
from ..bodies import Assembly
from ..measures import Network
from ..record import TriaxialRecord
from ..run import stored_record
from ..storage import load_run
from .extended_xyz import write_extended_xyz
from .picture import write_image, write_picture
from .run_figure import motion_figure, sample_figure, slope_figure, triaxial_figure
from .view import view_sample
from .vtk import write_vtk

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Export", "Run", "export_run", "network_of_run", "read_run"]

Export = Literal["vtk", "xyz", "picture", "plot"]


@dataclass(frozen=True, kw_only=True, repr=False)
class Run(Summary):
    """A run file in memory, finished or not: `read_run("run.h5")`."""

    path: Path
    content: dict[str, Any]  # what the file holds, by name; arrays in SI units, plain tensor components
    settings: dict[str, Any]  # what made it: the scene and what was chosen for it

    def _title(self) -> str:
        return f"{self.path.name}: {'a run that is not finished' if self.kind == 'unfinished' else self.kind}"

    def _rows(self) -> list[tuple[str, ...]]:
        return [field_cells(name, "", value) for name, value in (self.content | {"settings": self.settings}).items()]

    @property
    def kind(self) -> str:
        """ "triaxial", "motion" or "slope" of a finished run, "unfinished" while it goes on, "state" of a sample by itself."""
        if "stage" in self.content:
            return "unfinished"
        return {"record": "triaxial", "frames": "motion", "profile": "slope"}.get(
            next((name for name in ("record", "frames", "profile") if name in self.content), ""), "state"
        )

    @property
    def network(self) -> Network:
        """The last state: bodies, closed contacts, links; `InputError` where the file holds results only.

        Coefficients of friction are those of the scene: exact in the test, not during a compaction with another one.
        """
        if "assembly" not in self.content:
            raise InputError(f"{self.path}: holds no sample, only results; exports need the run file of a scene")
        scene = self.settings.get("scene", self.settings)
        # a test says the friction with its grains and wires, a motion with its contact law
        contact = scene.get("contact") or {}
        friction = float(contact.get("friction", (scene.get("grains") or {}).get("friction", float("nan"))))
        bead_friction = contact.get("bead_friction", (scene.get("wires") or {}).get("friction"))
        return Network.of_assembly(
            Assembly.from_arrays(self.content["assembly"]),
            friction=friction,
            bead_friction=None if bead_friction is None else float(bead_friction),
        )

    @property
    def record(self) -> TriaxialRecord:
        """What a finished triaxial test measured; `InputError` for any other run."""
        return stored_record(self.path, self.content, self.settings)

    def plot(
        self,
        *,
        view: str = "xz",
        quantity: str = "pressure",
        thickness: float | None = None,
        signs: str = "tension-positive",
    ) -> Figure:
        """A figure of the sample and of what was measured; `run.plot().savefig("run.svg")`.

        The sample is seen in the plane `view` ("xz", "xy", "yz") as a slice `thickness` [m] thick (default: four mean radii) through its
        middle, bodies coloured by `quantity` ("pressure", "contacts", "speed" or "radius"), wires as lines. Beside it stand, for a test,
        the equivalent stress √J₂ against axial strain and mean pressure, the volume strain and √J₂ by phase; for a motion energies and
        residual against time; for a deposit its free surface. `signs` turns the strains ("compression-positive"). Raises `InputError` for a
        word that is none of these, and for a file without a sample.
        """
        sample = {"view": view, "quantity": quantity, "thickness": thickness}
        network, title = self.network, self.path.name
        if self.kind == "triaxial":
            return triaxial_figure(network, self.record, title, signs, **sample)
        if self.kind == "motion":
            return motion_figure(network, self.content, title, **sample)
        if self.kind == "slope":
            return slope_figure(network, self.content, title, **sample)
        return sample_figure(network, title + (", not finished" if self.kind == "unfinished" else ""), **sample)

    def view(self, *, quantity: str = "pressure", show: bool = True) -> Any:
        """The last state in a window, to be turned with the mouse; returns the `pyvista.Plotter`, with `show` False without a window.

        Needs the extra `fenchel[view]`; `InputError` where it is missing, for an unknown quantity, and for a file without a sample.
        """
        return view_sample(self.network, quantity=quantity, show=show)


def read_run(path: Path | str) -> Run:
    """Read a run file, finished or not; `InputError` when it is unreadable."""
    content, settings = load_run(path)
    return Run(path=Path(path), content=content, settings=settings)


def network_of_run(path: Path | str) -> Network:
    """The network of the last state in a run file, finished or not; `InputError` where there is none (`Run.network`)."""
    return read_run(path).network


def export_run(path: Path | str, kind: Export, *, signs: str = "tension-positive") -> list[Path]:
    """Export the last state of `RUN.h5` beside it, and return the files: `RUN.bodies.vtp` and so on, `RUN.xyz`, or `RUN.png`.

    The kind "plot" is the figure of the whole run (`Run.plot`), `RUN.plot.png`, with the strains under `signs`; what other kinds hold has
    no sign to turn. Raises `InputError` for another kind and for a file without a sample, `StorageError` where a file cannot be written.
    """
    run = read_run(path)
    stem = Path(path).with_suffix("")
    if kind == "vtk":
        return write_vtk(run.network, stem)
    if kind == "xyz":
        return [write_extended_xyz(run.network, f"{stem}.xyz")]
    if kind == "picture":
        return [write_picture(run.network, f"{stem}.png")]
    if kind == "plot":
        return [write_image(run.plot(signs=signs), f"{stem}.plot.png")]
    raise InputError(f"export = {kind!r}: is one of vtk, xyz, picture, plot")
