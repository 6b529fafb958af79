"""The runs of a study as independent tasks: one per seed that prepares, one per test, one per stiffness probe.

A task is a plain value that can be pickled to another process; its run file is its result and its checkpoint, so that a study that was
stopped goes on where it was.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from ..campaign import progress_file, report_progress
from ..dem.bodies import Assembly
from ..dem.preparation import make_sample, material_of, preparation, pressure_change
from ..dem.record import TriaxialRecord
from ..dem.run import Stage, finished_test, record_of, run_stages, triaxial_stage
from ..dem.stepping import Drive, Material, Simulation, Solver
from ..dem.storage import load_run
from ..dem.triaxial import TriaxialTest, inertial_time
from ..errors import InputError
from .curves import curves
from .elastic import elastic_moduli
from .study import Study

__all__ = ["Prepare", "Probe", "Test", "probes_of"]


def _settings(study: Study, **more: Any) -> dict[str, Any]:
    """What a run depends on: not the other seeds, pressures or the identification."""
    whole = msgspec.to_builtins(study)
    kept = {key: whole[key] for key in ("grains", "wires", "sample")}
    kept["solve"] = {key: whole["solve"][key] for key in ("tolerance", "sweep_limit", "step")}
    return kept | more


def _weight(study: Study) -> float:
    """Work of a sample against one of a thousand grains."""
    return study.grains.count / 1000.0


def _told(label: str) -> str:
    return f"{label}, " if label else ""


def _stem(label: str) -> str:
    return f"{label.replace(' ', '_')}_" if label else ""


@dataclass(frozen=True)
class Prepare:
    """Sample of one seed at rest at every pressure, one state file each."""

    study: Study
    seed: int
    folder: Path
    label: str = ""  # tells the samples of several studies in one folder apart

    @property
    def name(self) -> str:
        """Of the task, and of its progress file."""
        return f"{_told(self.label)}seed {self.seed}: preparation"

    @property
    def cost(self) -> float:
        """Rough share of the whole work."""
        return (2.0 + 0.3 * (len(self.study.pressures) - 1)) * _weight(self.study)

    @property
    def needs(self) -> tuple[str, ...]:
        """Nothing."""
        return ()

    def state_file(self, pressure: float) -> Path:
        """Where the state at a pressure is."""
        return self.folder / f"{_stem(self.label)}seed{self.seed}_{pressure / 1e3:g}kPa_state.h5"

    def __call__(self) -> None:
        """Walk through the pressures in rising order; each starts from the state before."""
        study = self.study
        levels = study.pressures
        for k, pressure in enumerate(levels):
            makers: list[Callable[[Assembly], Stage]]
            if k == 0:
                makers = [*preparation(study.grains, study.wires, study.sample, study.solve, pressure)]
                begin = partial(make_sample, study.grains, study.wires, study.sample, self.seed)
            else:
                before = levels[k - 1]
                makers = [
                    partial(
                        pressure_change,
                        grains=study.grains,
                        wires=study.wires,
                        solve=study.solve,
                        before=before,
                        pressure=pressure,
                    )
                ]
                begin = partial(_load_state, self.state_file(before))
            run_stages(
                makers,
                begin,
                self.state_file(pressure),
                _settings(study, seed=self.seed, pressures=levels[: k + 1]) | {"kind": "state"},
                _state_content,
                progress=lambda p, k=k: report_progress(
                    progress_file(self.folder, self.name), replace(p, fraction=(k + p.fraction) / len(levels))
                ),
            )


def _state_content(assembly: Assembly, stage: Stage) -> dict[str, Any]:
    return {"assembly": assembly.arrays()}


def _load_state(path: Path) -> Assembly:
    content, _ = load_run(path)
    if "stage" in content:
        raise InputError(f"{path}: the preparation is not finished; run the study again")
    return Assembly.from_arrays(content["assembly"])


@dataclass(frozen=True)
class Test:
    """One triaxial test of one sample at one pressure, with or without links."""

    study: Study
    seed: int
    pressure: float
    linked: bool
    folder: Path
    label: str = ""

    @property
    def name(self) -> str:
        """Of the task, and of its progress file."""
        return f"{_told(self.label)}seed {self.seed}: {self.pressure / 1e3:g} kPa, {'links on' if self.linked else 'control'}"

    @property
    def cost(self) -> float:
        """Rough share of the whole work."""
        path = self.study.triaxial.strain_path
        walked = sum(abs(b - a) for a, b in pairwise(path)) / 0.042
        return (1.2 if self.linked else 1.0) * walked * _weight(self.study)

    @property
    def needs(self) -> tuple[str, ...]:
        """The sample."""
        return (Prepare(self.study, self.seed, self.folder, self.label).name,)

    @property
    def run_file(self) -> Path:
        """Where the record is."""
        kind = "linked" if self.linked else "unlinked"
        return self.folder / f"{_stem(self.label)}seed{self.seed}_{self.pressure / 1e3:g}kPa_{kind}.h5"

    def __call__(self) -> TriaxialRecord:
        """Run or go on with the test; returns its record."""
        study, t = self.study, self.study.triaxial
        settings = _settings(study, seed=self.seed, pressure=self.pressure, linked=self.linked) | {
            "pressures": [p for p in study.pressures if p <= self.pressure],
            "triaxial": {
                "strain_path": list(t.strain_path),
                "inertial_number": t.inertial_number,
                "sphere": t.sphere,
                "frame_strain": t.frame_strain,
            },
        }

        test = partial(
            triaxial_stage,
            grains=study.grains,
            wires=study.wires,
            path=t,
            solve=study.solve,
            pressure=self.pressure,
            linked=self.linked,
        )
        content = run_stages(
            [test],
            partial(_load_state, Prepare(study, self.seed, self.folder, self.label).state_file(self.pressure)),
            self.run_file,
            settings,
            partial(finished_test, seed=self.seed),
            progress=partial(report_progress, progress_file(self.folder, self.name)),
        )
        return record_of(content, settings)


@dataclass(frozen=True)
class Probe:
    """The first 0.05 % of a test under another tolerance, step or grain stiffness: what does E_s owe to the solver?"""

    study: Study
    seed: int
    folder: Path
    rigid: bool = False
    step: float = 1.0  # over that of the study
    tolerance: float | None = None  # stop there; None: stop at `sweeps`, converged or not
    sweeps: int = 100_000

    @property
    def name(self) -> str:
        """Of the task, and of its progress file."""
        stop = f"tolerance {self.tolerance:g}" if self.tolerance else f"{self.sweeps} sweeps"
        return f"stiffness: {'rigid' if self.rigid else 'compliant'} grains, {stop}, step x {self.step:g}"

    @property
    def cost(self) -> float:
        """Rough share of the whole work."""
        return 0.3 * _weight(self.study)

    @property
    def needs(self) -> tuple[str, ...]:
        """The sample."""
        return (Prepare(self.study, self.seed, self.folder).name,)

    def __call__(self) -> dict[str, Any]:
        """A row of the table: settings, secant moduli at 0.02 and 0.05 %, residuals reached."""
        study, t = self.study, self.study.triaxial
        pressure = study.pressures[0]
        assembly = _load_state(Prepare(study, self.seed, self.folder).state_file(pressure))
        law: Material = material_of(study.grains, study.wires)
        if self.rigid:
            law = replace(law, normal_stiffness=np.inf, tangential_stiffness=np.inf)
        solver = Solver(
            tolerance=self.tolerance or 1e-13, sweep_limit=self.sweeps, keep_unconverged=self.tolerance is None
        )
        step = study.solve.step * self.step
        if self.rigid:
            # the deflections of the compliant state stay as overlaps; forces settle anew
            drive = Drive(pressure=np.full(3, pressure))
            rest = Simulation(assembly, replace(law, links=False), solver)
            for _ in range(round(2.0 / step)):
                rest.advance(step * inertial_time(assembly, pressure, study.grains.density), drive)
        test = TriaxialTest(
            assembly,
            law,
            solver,
            pressure=pressure,
            density=study.grains.density,
            strain_path=(0.0, -5.2e-4),
            inertial_number=t.inertial_number,
            step_fraction=step,
            sphere=t.sphere,
            frame_strain=2.5e-5,
            prestressed=study.wires is not None and study.wires.state == "prestressed",
        )
        while not test.done:
            test.advance()
        record = test.record(seed=self.seed, settings={})
        q = record.wall_stress[:, 2] - 0.5 * (record.wall_stress[:, 0] + record.wall_stress[:, 1])
        strain = -record.axial_strain

        sphere = elastic_moduli([curves(record.history())], replace(study.options(), window_wire=5e-4)).E_s

        def secant(level: float) -> float:
            return float(-(np.interp(level, strain, q) - q[0]) / level / 1e6)

        return {
            "grains": "rigid" if self.rigid else "compliant",
            "tolerance": self.tolerance,
            "sweeps a step": record.quality["sweeps_mean"],
            "inertial time / step": record.quality["inertial_time_over_step"],
            "E_s in the sphere [MPa]": sphere / 1e6,
            "E_s at 0.02 % [MPa]": secant(2e-4),
            "E_s at 0.05 % [MPa]": secant(5e-4),
            "natural map": record.quality["natural_map_median"],
            "relative impulse change": float(np.median(record.series["change"])),
            "unbalanced force": record.quality["unbalanced_median"],
        }


def probes_of(study: Study, folder: Path) -> list[Probe]:
    """The probes of a study: its own grains at half the tolerance and half the step, then the same grains made rigid."""
    make = partial(Probe, study, study.solve.seeds[0], folder)
    tolerance = study.solve.tolerance
    own = []
    if study.grains.normal_stiffness is not None:
        own = [
            make(tolerance=tolerance),
            make(tolerance=tolerance / 2),
            make(tolerance=tolerance, step=0.5),
            make(tolerance=tolerance / 2, step=0.5),
        ]
    rigid = [make(rigid=True, sweeps=n) for n in (5, 20, 100, 500)]
    return [*own, *rigid, make(rigid=True, sweeps=20, step=0.5)]
