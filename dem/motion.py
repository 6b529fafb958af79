"""A run of free bodies: steps to the end of the duration, frames on the way, the same run file as any other."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from ..errors import InputError
from .adaptive import AdaptiveStep
from .bodies import Assembly
from .motion_scene import MotionScene, bodies_of, check_motion_scene, laws_of, planes_of, read_motion_scene
from .residual import MEASURES
from .run import Progress, Stage, run_stages
from .stepping import Drive, Simulation, Solver

__all__ = ["MotionStage", "run_motion"]

_SUMMED = ("friction", "algorithmic", "wires", "shock", "damping", "weight", "drive", "external", "balance")


class MotionStage:
    """A motion in progress; `advance` makes one step and stores a frame when its time has come."""

    name = "motion"

    def __init__(self, assembly: Assembly, scene: MotionScene) -> None:
        m, s = scene.motion, scene.solve
        self.scene = scene
        solver = Solver(tolerance=s.tolerance, sweep_limit=s.sweep_limit, keep_unconverged=s.keep_unconverged)
        self.simulation = Simulation(
            assembly, laws_of(scene), solver, planes=planes_of(scene), skin=m.skin, theta=m.theta, threads=m.threads
        )
        self.drive = Drive(gravity=np.array(m.gravity or (0.0,) * scene.dimension))
        least = m.least_step or m.step
        self.pace = AdaptiveStep(
            simulation=self.simulation, most=m.step, least=least, travel=0.5 if m.least_step else np.inf
        )
        self.steps = 0
        self.sums = dict.fromkeys(_SUMMED, 0.0)
        self.worst = 0.0  # natural map
        self.frames: dict[str, list[Any]] = {
            name: [] for name in ("time", "step", "sweeps", "x", "velocity", *MEASURES)
        }

    @property
    def assembly(self) -> Assembly:
        """The bodies."""
        return self.simulation.assembly

    @property
    def done(self) -> bool:
        """True when the duration is over."""
        return self.assembly.time >= self.scene.motion.duration * (1.0 - 1e-12)

    @property
    def fraction(self) -> float:
        """Share of the duration that is behind."""
        return min(1.0, self.assembly.time / self.scene.motion.duration)

    def advance(self) -> dict[str, float]:
        """One step; returns its measures."""
        m = self.scene.motion
        measures = self.pace.advance(self.drive, until=m.duration)
        self.steps += 1
        for name in _SUMMED:
            self.sums[name] += measures[name]
        self.worst = max(self.worst, measures["natural_map"])
        if self.assembly.time >= (len(self.frames["time"]) + 1) / m.frames * m.duration * (1.0 - 1e-12) or self.done:
            values = measures | self.sums
            a = self.assembly
            values |= {"time": a.time, "step": a.step, "sweeps": float(self.simulation.sweeps)}
            for name in ("time", "step", "sweeps", *MEASURES):
                self.frames[name].append(values[name])
            # the configuration at the end of the step, not that of detection
            self.frames["x"].append(a.x - a.step * (1.0 - m.theta) * a.velocity)
            self.frames["velocity"].append(a.velocity.copy())
        return measures

    def state(self) -> dict[str, Any]:
        """What a checkpoint needs beside the assembly; `restore` makes the motion go on bit for bit."""
        return {
            "steps": self.steps,
            "next_step": self.pace.step,
            "cuts": self.pace.cuts,
            "worst": self.worst,
            "sums": dict(self.sums),
            "sweeps": self.simulation.total_sweeps,
            "rows": self.simulation.total_rows,
            "frames": {name: np.array(values) for name, values in self.frames.items()},
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Inverse of `state`."""
        self.steps, self.pace.cuts = int(state["steps"]), int(state["cuts"])
        self.pace.step, self.worst = float(state["next_step"]), float(state["worst"])
        self.sums = {name: float(state["sums"][name]) for name in _SUMMED}
        self.simulation.total_sweeps, self.simulation.total_rows = int(state["sweeps"]), int(state["rows"])
        self.frames = {name: list(state["frames"][name]) for name in self.frames}

    def quality(self) -> dict[str, float]:
        """How well the motion was solved, and where its energy went, in J."""
        last = {name: float(self.frames[name][-1]) for name in MEASURES}
        return {
            "steps": float(self.steps),
            "step_cuts": float(self.pace.cuts),
            "sweeps_mean": self.simulation.total_sweeps / max(self.steps, 1),
            "contact_iterations": float(self.simulation.total_rows),
            "natural_map_max": self.worst,
            "overlap_mean": last["overlap_mean"],
            "overlap_max": last["overlap_max"],
            "kinetic": last["kinetic"],
            "elastic": last["elastic"],
        } | self.sums


QUALITY = {  # unit and meaning of what `quality` holds
    "steps": ("1", "time steps"),
    "step_cuts": ("1", "halvings of the step"),
    "sweeps_mean": ("1", "sweeps a step"),
    "contact_iterations": ("1", "rows times sweeps"),
    "natural_map_max": ("1", "largest residual ‖p − P_K(p − ρû)‖/‖p‖ of a step, recomputed"),
    "overlap_mean": ("m", "mean overlap of closed contacts at the end"),
    "overlap_max": ("m", "largest overlap at the end"),
    "kinetic": ("J", "kinetic energy at the end"),
    "elastic": ("J", "elastic energy of contacts and links at the end"),
    "friction": ("J", "dissipated by friction"),
    "algorithmic": ("J", "dissipated by the implicit compliance, links included"),
    "wires": ("J", "the links' part of it"),
    "shock": ("J", "dissipated by inelastic shocks, less what restitution and recovery gave back"),
    "damping": ("J", "dissipated by the scheme (θ > ½)"),
    "weight": ("J", "work of the weight"),
    "drive": ("J", "work of driven planes"),
    "external": ("J", "work of weight and drives"),
    "balance": ("J", "energy not accounted for: change of geometry within steps"),
}


def run_motion(
    scene_file: Path | str | MotionScene,
    run_file: Path | str,
    *,
    resume: bool = False,
    progress: Callable[[Progress], None] | None = None,
    every: float = 30.0,
) -> dict[str, Any]:
    """Let the bodies move and leave everything in `run_file`; returns the content of the file.

    `frames` holds times, places, velocities and measures (energies dissipated so far), `quality` the summary, `kernels` the generated code
    by name with the bytes of a row. Raises `InputError` for a bad scene or run file, `ConvergenceError` for an unconverged step,
    `StorageError` when the file cannot be written.
    """
    scene = check_motion_scene(scene_file) if isinstance(scene_file, MotionScene) else read_motion_scene(scene_file)
    from .accuracy import resolved

    chosen, choice = resolved(scene, run_file)
    assert isinstance(chosen, MotionScene)
    settings = {"scene": msgspec.to_builtins(scene), **choice}
    if Path(run_file).exists() and not resume:
        raise InputError(f"{run_file}: exists already; say --resume to go on with it, or choose another name")

    def finish(assembly: Assembly, stage: Stage) -> dict[str, Any]:
        assert isinstance(stage, MotionStage)
        return {
            "frames": {name: np.array(values) for name, values in stage.frames.items()},
            "quality": stage.quality(),
            "kernels": stage.simulation.kernels.report(),
            "assembly": assembly.arrays(),
        }

    return run_stages(
        [lambda assembly: MotionStage(assembly, chosen)],
        lambda: bodies_of(scene),
        run_file,
        settings,
        finish,
        progress=progress,
        every=every,
    )
