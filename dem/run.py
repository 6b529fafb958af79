"""Runs: a list of stages walked to the end, with progress, checkpoints that resume bit for bit, and a record at the end.

The run file is the checkpoint: it is replaced atomically while the run goes on and holds the record when it is over.
"""

from __future__ import annotations

import json
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import msgspec
import numpy as np

from ..errors import InputError
from .bodies import Assembly
from .preparation import make_sample, material_of, preparation
from .record import TriaxialRecord
from .scene import Grains, Scene, SceneSolve, TestPath, Wires, read_scene
from .stepping import Solver
from .storage import load_run, save_run
from .triaxial import TriaxialTest

__all__ = [
    "Progress", "Stage", "finished_test", "load_record", "record_content", "record_of", "run_scene", "run_stages", "stored_record",
    "triaxial_stage", "walk",
]  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Progress:
    """What a progress bar shows."""

    stage: str
    fraction: float  # of all stages
    step: int
    strain: float
    residual: float  # natural map of the last step
    kinetic: float  # kinetic energy [J]


class Stage(Protocol):
    """A part of a run that advances step by step and can be put aside and taken up again."""

    name: str
    steps: int

    @property
    def done(self) -> bool: ...
    @property
    def fraction(self) -> float: ...
    @property
    def assembly(self) -> Assembly: ...
    def advance(self) -> dict[str, float]: ...
    def state(self) -> dict[str, Any]: ...
    def restore(self, state: dict[str, Any]) -> None: ...


def walk(
    stage: Stage,
    *,
    share: tuple[float, float] = (0.0, 1.0),
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Callable[[], None] | None = None,
    every: float = 30.0,
) -> None:
    """Advance a stage to its end; `share` is its part of the whole for the bar, `every` [s] the pace of checkpoints.

    An interrupt from the keyboard is taken between two steps: checkpoint, then `KeyboardInterrupt`.
    """
    # a step that leaves the range of numbers is refused by its own check, not by a warning of numpy beside it
    with _interrupts() as stopped, np.errstate(over="ignore", invalid="ignore"):
        _walk(stage, share, progress, checkpoint, every, stopped)


@contextmanager
def _interrupts() -> Iterator[list[bool]]:
    """A list that is no longer empty once the user has pressed Ctrl-C (in the main thread; elsewhere Python raises as ever)."""
    pressed: list[bool] = []
    if threading.current_thread() is not threading.main_thread():
        yield pressed
        return
    before = signal.signal(signal.SIGINT, lambda *_: pressed.append(True))
    try:
        yield pressed
    finally:
        signal.signal(signal.SIGINT, before)


def _walk(
    stage: Stage,
    share: tuple[float, float],
    progress: Callable[[Progress], None] | None,
    checkpoint: Callable[[], None] | None,
    every: float,
    stopped: list[bool],
) -> None:
    shown = 0.0
    saved = time.monotonic()
    while not stage.done:
        measures = stage.advance()
        if stopped:
            if checkpoint is not None:
                checkpoint()
            raise KeyboardInterrupt
        now = time.monotonic()
        if progress is not None and now - shown > 0.25:
            shown = now
            progress(
                Progress(
                    stage=stage.name,
                    fraction=share[0] + (share[1] - share[0]) * stage.fraction,
                    step=stage.steps,
                    strain=getattr(stage, "strain", 0.0),
                    residual=measures["natural_map"],
                    kinetic=measures["kinetic"],
                )
            )
        if checkpoint is not None and now - saved > every:
            checkpoint()
            # a checkpoint may not take more than a twentieth of the time
            took = time.monotonic() - now
            saved = now + took
            every = max(every, 20.0 * took)


def run_stages(
    makers: Sequence[Callable[[Assembly], Stage]],
    begin: Callable[[], Assembly],
    run_file: Path | str,
    settings: dict[str, Any],
    finish: Callable[[Assembly, Stage], dict[str, Any]],
    *,
    progress: Callable[[Progress], None] | None = None,
    every: float = 30.0,
) -> dict[str, Any]:
    """Walk stages one after the other from `begin()`, or from where `run_file` stands; returns the content of the finished file.

    A stage is made when its turn comes, from the assembly as it is then. Raises `InputError` when the file is unreadable or belongs to
    other settings, `StorageError` when it cannot be written.
    """
    run_file = Path(run_file)
    at, state = 0, {}
    if run_file.exists():
        content, before = load_run(run_file)
        if before != json.loads(json.dumps(settings)):
            raise InputError(f"{run_file}: was started with other settings; choose another place, or remove it")
        if "stage" not in content:
            return content
        at, state = int(content["stage"]), content["state"]
        assembly = Assembly.from_arrays(content["assembly"])
    else:
        assembly = begin()
        save_run(run_file, {"stage": 0, "state": {}, "assembly": assembly.arrays()}, settings)
    stage: Stage | None = None
    for k in range(at, len(makers)):
        stage = makers[k](assembly)
        if state:
            stage.restore(state)
            state = {}

        def checkpoint(k: int = k, stage: Stage = stage) -> None:
            save_run(run_file, {"stage": k, "state": stage.state(), "assembly": assembly.arrays()}, settings)

        share = (k / len(makers), (k + 1) / len(makers))
        walk(stage, share=share, progress=progress, checkpoint=checkpoint, every=every)
    assert stage is not None
    content = finish(assembly, stage)
    save_run(run_file, content, settings)
    return content


def run_scene(
    scene_file: Path | str | Scene,
    run_file: Path | str,
    *,
    resume: bool = False,
    progress: Callable[[Progress], None] | None = None,
    every: float = 30.0,
) -> TriaxialRecord:
    """Make the sample, test it, and leave everything in `run_file`.

    With `resume` an interrupted run goes on from its last checkpoint, bit for bit; the scene must be the one that started it. Raises
    `InputError` for a bad scene or run file, `ConvergenceError` for an unconverged step, `StorageError` when the file cannot be written.
    """
    scene = scene_file if isinstance(scene_file, Scene) else read_scene(scene_file)
    from .accuracy import resolved

    chosen, choice = resolved(scene, run_file)
    assert isinstance(chosen, Scene)
    settings = {"scene": msgspec.to_builtins(scene), **choice}
    if Path(run_file).exists() and not resume:
        raise InputError(f"{run_file}: exists already; say --resume to go on with it, or choose another name")
    content = run_stages(
        _stages(scene, chosen.solve),
        lambda: make_sample(scene.grains, scene.wires, scene.sample, scene.seed),
        run_file,
        settings,
        lambda assembly, stage: finished_test(assembly, stage, scene.seed),
        progress=progress,
        every=every,
    )
    return record_of(content, settings)


def finished_test(assembly: Assembly, stage: Stage, seed: int) -> dict[str, Any]:
    """Content of the run file of a finished test: the record, the last state and the code that was generated."""
    assert isinstance(stage, TriaxialTest)
    kernels = stage.simulation.kernels.report()
    return {
        "record": record_content(stage.record(seed=seed, settings={})),
        "assembly": assembly.arrays(),
        "kernels": kernels,
    }


def triaxial_stage(
    assembly: Assembly,
    grains: Grains,
    wires: Wires | None,
    path: TestPath,
    solve: SceneSolve,
    pressure: float,
    *,
    linked: bool = True,
) -> TriaxialTest:
    """The test of an assembly at rest at `pressure` [Pa]; `linked` False is the control with the same beads unlinked."""
    law = material_of(grains, wires)
    return TriaxialTest(
        assembly,
        replace(law, links=law.links and linked),
        Solver(tolerance=solve.tolerance, sweep_limit=solve.sweep_limit),
        pressure=pressure,
        density=grains.density,
        strain_path=path.strain_path,
        inertial_number=path.inertial_number,
        step_fraction=solve.step,
        sphere=path.sphere,
        frame_strain=path.frame_strain,
        prestressed=wires is not None and wires.state == "prestressed",
    )


def _stages(scene: Scene, solve: SceneSolve) -> list[Callable[[Assembly], Stage]]:
    """Makers of the stages of a scene, `solve` for its test: a stage is made when its turn comes, from the assembly as it is then."""
    pressure = scene.triaxial.pressure
    test = partial(
        triaxial_stage,
        grains=scene.grains,
        wires=scene.wires,
        path=scene.triaxial,
        solve=solve,
        pressure=pressure,
    )
    return [*preparation(scene.grains, scene.wires, scene.sample, scene.solve, pressure), test]


def record_content(record: TriaxialRecord) -> dict[str, Any]:
    """A record as a nested dictionary for storage: plain tensor components (xx, yy, zz, yz, xz, xy), shear not doubled.

    The homogenised histories stand beside the sums they follow from, for whoever opens the file with another program.
    """
    content = {f.name: getattr(record, f.name) for f in fields(record) if f.name != "settings"}
    history = record.history()
    names = ("strain_sand", "strain_wire", "stress_grains", "stress_beads", "stress_links")
    return (
        content
        | {name: content[name] / _MANDEL for name in _SYMMETRIC}
        | {"history": {name: getattr(history, name) / _MANDEL for name in names}}
    )


_SYMMETRIC = ("wall_strain", "wall_stress", "box_stress")
_MANDEL = np.array([1.0, 1.0, 1.0, np.sqrt(2.0), np.sqrt(2.0), np.sqrt(2.0)])


def record_of(content: dict[str, Any], settings: dict[str, Any]) -> TriaxialRecord:
    """The record in the content of a finished run."""
    stored = {key: value for key, value in content["record"].items() if key != "history"}
    return TriaxialRecord(**stored | {name: stored[name] * _MANDEL for name in _SYMMETRIC}, settings=settings)


def load_record(path: Path | str) -> TriaxialRecord:
    """The record of a finished run; `InputError` when the file is unreadable or the run not finished."""
    return stored_record(path, *load_run(path))


def stored_record(path: Path | str, content: dict[str, Any], settings: dict[str, Any]) -> TriaxialRecord:
    """The record in what was read from `path`; `InputError` when the run is not finished, or is no test."""
    if "record" not in content:
        raise InputError(f"{path}: the run is not finished; go on with `fenchel dem ... --resume`")
    try:
        return record_of(content, settings)
    except (KeyError, TypeError):
        raise InputError(f"{path}: the record is incomplete; run it again") from None
