r"""The triaxial test: lateral walls keep the pressure, the axial pair follows a path of logarithmic strain.

The rate follows from the inertial number, ε̇ = I/t_i with t_i = d √(ρ/P), d = 2 r̄; the wall velocity is ramped over 3 t_i up from the
start and from every reversal and down before it, so that no shock is measured and no strain is overshot. Strains count from the
start of the test. The measuring sphere is fixed in space at the centre of the box; the reference set of the strain is the bodies
whose centres lie in it at the start.

Inertial number: GDR MiDi (2004), Eur. Phys. J. E 14, 341–365.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .bodies import Assembly
from .homogenise import fit_sums, moments, wall_stress
from .record import TriaxialRecord, mandel
from .stepping import Drive, Material, Simulation, Solver

__all__ = ["QUALITY", "TriaxialTest", "inertial_time"]

Array = NDArray[np.float64]

QUALITY = {  # what `TriaxialRecord.quality` holds: unit and meaning
    "inertial_number": ("1", "largest I = ε̇ t_i that was driven"),
    "unbalanced_median": ("1", "mean net force of bodies / mean contact force, median over frames"),
    "unbalanced_max": ("1", "the same, largest over all steps"),
    "natural_map_median": ("1", "residual ‖p − P_K(p − ρû)‖/‖p‖ recomputed, median over frames"),
    "natural_map_max": ("1", "the same, largest over all steps"),
    "change_max": ("1", "largest relative impulse change at which sweeps stopped"),
    "sweeps_mean": ("1", "sweeps a step"),
    "violation_over_radius": ("1", "largest gap less elastic deflection / mean radius"),
    "overlap_mean_over_radius": ("1", "mean overlap of closed contacts / mean radius"),
    "overlap_max_over_radius": ("1", "largest overlap / mean radius"),
    "kappa": ("1", "k_n/(P d), inf for rigid grains"),
    "inertial_time_over_step": ("1", "t_i/h"),
    "energy_error": ("1", "largest energy not accounted for / largest external work"),
    "wall_box_difference": ("1", "wall stress against the homogenised stress of the box, largest over frames"),
    "wall_sphere_difference": ("1", "the same for the measuring sphere"),
    "solid_fraction": ("1", "grains and beads in the box"),
    "grain_fraction": ("1", "grains alone"),
    "bead_fraction": ("1", "beads alone"),
    "wire_density": ("m⁻²", "wire length per volume of the box"),
    "steps": ("1", "time steps"),
    "contact_iterations": ("1", "rows times sweeps"),
}

_SUMMED = ("friction", "algorithmic", "shock", "external", "balance")
_SERIES = (
    "natural_map", "natural_map_max", "violation_max", "overlap_mean", "overlap_max", "force_mean", "unbalanced", "sliding",
    "closed", "elastic", "kinetic", *_SUMMED, "sweeps", "change", "inertial_number",
)  # fmt: skip
_PEAKS = (
    "natural_map",
    "unbalanced",
    "violation_max",
    "overlap_max",
    "change",
)  # largest over all steps, not only over frames
_FRAMES = ("leg", "axial_strain", "wall_strain", "wall_stress", "box_stress", "moment", "grain_fit", "bead_fit")


def inertial_time(assembly: Assembly, pressure: float, density: float) -> float:
    """t_i = d √(ρ/P) [s], d the mean grain diameter."""
    return 2.0 * assembly.grain_radius * float(np.sqrt(density / pressure))


class TriaxialTest:
    """A test in progress: `advance` makes one step, `record` homogenises what was measured so far.

    The links' reference lengths are reset to the present lengths (stress-free wires) unless `prestressed`.
    """

    def __init__(
        self,
        assembly: Assembly,
        material: Material,
        solver: Solver,
        *,
        pressure: float,
        density: float,
        strain_path: tuple[float, ...],
        inertial_number: float = 5e-4,
        step_fraction: float = 0.05,
        sphere: float = 0.8,
        frame_strain: float = 1e-4,
        prestressed: bool = False,
    ) -> None:
        if not pressure > 0.0:
            raise InputError(f"pressure = {pressure} Pa: grains without cohesion need a positive confining pressure")
        self.simulation: Simulation = Simulation(assembly, material, solver, reach=0.04 * assembly.grain_radius)
        self.name: str = f"triaxial at {pressure / 1e3:g} kPa"
        self.pressure = pressure
        self.path: tuple[float, ...] = tuple(float(e) for e in strain_path)
        self.time_scale: float = inertial_time(assembly, pressure, density)
        self.step: float = step_fraction * self.time_scale
        self.rate: float = inertial_number / self.time_scale
        self.frame_strain = frame_strain
        self.start_half: Array = assembly.half.copy()
        self.start_x: Array = assembly.x.copy()
        self.sphere: float = sphere * float(assembly.half.min())
        self.prestressed = prestressed
        self.leg: int = 0
        self.speed: float = 0.0  # present strain rate over the nominal one, signed
        self.steps: int = 0
        self.sums: dict[str, float] = dict.fromkeys(_SUMMED, 0.0)
        self.peaks: dict[str, float] = dict.fromkeys(_PEAKS, 0.0)
        self.frames: dict[str, list[Any]] = {name: [] for name in (*_FRAMES, *_SERIES)}

    @property
    def assembly(self) -> Assembly:
        """The sample."""
        return self.simulation.assembly

    @property
    def strain(self) -> float:
        """Logarithmic axial strain since the start [-]."""
        return float(np.log(self.assembly.half[2] / self.start_half[2]))

    @property
    def done(self) -> bool:
        """True when the path is walked."""
        return self.leg >= len(self.path) - 1

    @property
    def fraction(self) -> float:
        """Share of the path that is behind."""
        legs = np.abs(np.diff(self.path))
        if self.done:
            return 1.0
        walked = legs[: self.leg].sum() + min(abs(self.strain - self.path[self.leg]), legs[self.leg])
        return float(walked / legs.sum())

    def advance(self) -> dict[str, float]:
        """One step, returns its measures.

        A frame is stored at the start, every `frame_strain` (a quarter of it at first), and at the end of each leg.
        """
        if self.steps == 0:
            # loose bodies still drift after the preparation: caught by links they would make a shock
            self.assembly.velocity[:] = 0.0
            self.assembly.spin[:] = 0.0
            if not self.prestressed:
                self.assembly.release_links()
        target = self.path[self.leg + 1]
        heading = 1.0 if target > self.path[self.leg] else -1.0
        ramp = self.step / (3.0 * self.time_scale)
        # the first step only brings the sample to rest under the law of the test: frame zero
        if self.steps > 0:
            # brake so as to arrive slowly: 3 t_i of constant deceleration take 1.5 I of strain
            remaining = max((target - self.strain) * heading, 0.0)
            most = min(1.0, max(0.05, float(np.sqrt(remaining / (1.5 * self.rate * self.time_scale)))))
            self.speed = float(np.clip(self.speed + heading * ramp, -most, most))
        drive = Drive(pressure=np.full(3, self.pressure))
        drive.rate[2] = self.speed * self.rate * self.assembly.half[2]
        measures = self.simulation.advance(self.step, drive)
        self.steps += 1
        for name in _SUMMED:
            self.sums[name] += measures[name]
        for name in _PEAKS:
            value = self.simulation.change if name == "change" else measures[name]
            self.peaks[name] = max(self.peaks[name], value)
        leg = self.leg
        reached = (self.strain - target) * heading >= 0.0
        if reached:
            self.leg += 1
        last = self.frames["axial_strain"][-1] if self.frames["axial_strain"] else np.inf
        # four times as dense where the sample is nearly elastic
        spacing = (
            0.25 * self.frame_strain if leg == 0 and abs(self.strain) < 4.0 * self.frame_strain else self.frame_strain
        )
        if reached or not np.abs(self.strain - last) < spacing * (1.0 - 1e-9):
            self._store(measures, leg)
        return measures

    def _store(self, measures: dict[str, float], leg: int) -> None:
        rows = self.simulation.contacts
        assert rows is not None
        a = self.assembly
        keep = self.frames
        keep["leg"].append(leg)
        keep["axial_strain"].append(self.strain)
        keep["wall_strain"].append(np.concatenate([np.log(a.half / self.start_half), np.zeros(3)]))
        keep["wall_stress"].append(np.concatenate([wall_stress(rows), np.zeros(3)]))
        moment = moments(a, rows, self.sphere)
        keep["moment"].append(moment[:, :8])
        keep["box_stress"].append(mandel(moment[:, 8].sum(axis=0) / (8.0 * float(np.prod(rows.half)))))
        inside = np.sum(self.start_x**2, axis=1) < self.sphere**2
        octant = ((self.start_x > 0.0) @ np.array([1, 2, 4])).astype(np.int64)
        # displacement with the homogeneous box motion left in: the fit is exact for it
        moved = a.x - self.start_x
        keep["grain_fit"].append(fit_sums(self.start_x, moved, inside & ~a.is_bead, octant))
        keep["bead_fit"].append(fit_sums(self.start_x, moved, inside & a.is_bead, octant))
        values = measures | self.sums
        values["sweeps"] = float(self.simulation.sweeps)
        values["change"] = self.simulation.change
        values["inertial_number"] = abs(self.speed) * self.rate * self.time_scale
        for name in _SERIES:
            keep[name].append(values[name])

    def record(self, *, seed: int, settings: dict[str, Any]) -> TriaxialRecord:
        """The record of the frames so far, with a summary of quality."""
        f = {name: np.array(values) for name, values in self.frames.items()}
        series = {name: f[name] for name in _SERIES}
        return TriaxialRecord(
            pressure=self.pressure,
            seed=seed,
            linked=self.simulation.kernels.wire is not None,
            leg=f["leg"],
            axial_strain=f["axial_strain"],
            wall_strain=f["wall_strain"],
            wall_stress=f["wall_stress"],
            box_stress=f["box_stress"],
            octant_volume=np.full(8, np.pi / 6.0 * self.sphere**3),
            grain_moment=f["moment"][:, 0],
            bead_moment=f["moment"][:, 1],
            link_moment=f["moment"][:, 2],
            grain_fit=f["grain_fit"],
            bead_fit=f["bead_fit"],
            series=series,
            quality=self._quality(f),
            settings=settings,
        )

    def state(self) -> dict[str, Any]:
        """What a checkpoint needs beside the assembly; `restore` makes the test go on bit for bit."""
        return {
            "leg": self.leg,
            "speed": self.speed,
            "steps": self.steps,
            "start_half": self.start_half,
            "start_x": self.start_x,
            "sphere": self.sphere,
            "sums": dict(self.sums),
            "peaks": dict(self.peaks),
            "sweeps": self.simulation.total_sweeps,
            "rows": self.simulation.total_rows,
            "frames": {name: np.array(values) for name, values in self.frames.items()},
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Inverse of `state`."""
        self.leg, self.steps = int(state["leg"]), int(state["steps"])
        self.speed, self.sphere = float(state["speed"]), float(state["sphere"])
        self.start_half, self.start_x = state["start_half"], state["start_x"]
        self.sums = {name: float(state["sums"][name]) for name in _SUMMED}
        self.peaks = {name: float(state["peaks"][name]) for name in _PEAKS}
        self.simulation.total_sweeps, self.simulation.total_rows = int(state["sweeps"]), int(state["rows"])
        self.frames = {name: list(state["frames"][name]) for name in self.frames}

    def _quality(self, f: dict[str, Array]) -> dict[str, float]:
        a, law = self.assembly, self.simulation.laws.contact
        stiffness = np.inf if law is None else law.normal_stiffness()
        radius = a.grain_radius
        wall = f["wall_stress"][:, :3]
        sphere = mandel(f["moment"].sum(axis=(1, 2)) / (4.0 / 3.0 * np.pi * self.sphere**3))[:, :3]
        scale = np.linalg.norm(wall, axis=1)
        return {
            "inertial_number": float(f["inertial_number"].max()),
            "unbalanced_median": float(np.median(f["unbalanced"])),
            "unbalanced_max": self.peaks["unbalanced"],
            "natural_map_median": float(np.median(f["natural_map"])),
            "natural_map_max": self.peaks["natural_map"],
            "change_max": self.peaks["change"],
            "sweeps_mean": self.simulation.total_sweeps / max(self.steps, 1),
            "violation_over_radius": self.peaks["violation_max"] / radius,
            "overlap_mean_over_radius": float(f["overlap_mean"].mean() / radius),
            "overlap_max_over_radius": self.peaks["overlap_max"] / radius,
            "kappa": stiffness / (self.pressure * 2.0 * radius),
            "inertial_time_over_step": self.time_scale / self.step,
            "energy_error": float(np.abs(f["balance"]).max() / max(np.abs(f["external"]).max(), 1e-300)),
            "wall_box_difference": float(np.max(np.linalg.norm(f["box_stress"][:, :3] - wall, axis=1) / scale)),
            "wall_sphere_difference": float(np.max(np.linalg.norm(sphere - wall, axis=1) / scale)),
            "solid_fraction": a.solid_fraction(),
            "grain_fraction": a.solid_fraction(grains_only=True),
            "bead_fraction": a.solid_fraction() - a.solid_fraction(grains_only=True),
            "wire_density": a.wire_density() if len(a.links) else 0.0,
            "steps": float(self.steps),
            "contact_iterations": float(self.simulation.total_rows),
        }
