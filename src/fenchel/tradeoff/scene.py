"""Speed against accuracy of a scene of grains: time step, tolerance and contact law, judged by what the scene is made for.

A triaxial scene is prepared once, and every setting tests the same sample; a scene of free bodies or a deposit runs as a whole. The
reference has half the finest step and a tenth of the finest tolerance; a second one with the tolerance ten times looser tells how well the
answer is known at all: grains that slide or not are sensitive to the last digit, and where two references differ by more than what is
wanted, no single run has it. Every error counts at least as much as that difference. The cost is processor time; contact iterations stand
beside it. Time stepping has one solver of its contacts, Gauss–Seidel, so that the solver is no axis here.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from ..campaign import Computation, run_campaign
from ..dem.accuracy import error_of, kind_of, measures_of, tested, with_setting
from ..dem.bodies import Assembly
from ..dem.motion_scene import MotionScene
from ..dem.scene import Scene
from ..dem.slope_scene import SlopeScene
from ..dem.storage import load_run
from ..errors import ConvergenceError, FenchelError, InputError
from ..front import Front, Measured, environment

__all__ = ["STEPS", "TOLERANCES", "measure_scene", "settings_of"]

AnyScene = Scene | MotionScene | SlopeScene
STEPS = {"triaxial": (0.025, 0.05, 0.1, 0.2), "motion": (0.5, 1.0, 2.0, 4.0), "slope": ()}  # of a motion: times its own
TOLERANCES = {"triaxial": (1e-6, 1e-5, 1e-4, 1e-3), "motion": (1e-7, 1e-6, 1e-5, 1e-4), "slope": (1e-4, 1e-3, 1e-2)}
KAPPAS = (1e3, 1e4)  # k_n/(P d) of compliant contacts tried in place of rigid ones
FRAMES = 50  # of a motion that are compared


def settings_of(
    scene: AnyScene, steps: Sequence[float] | None = None, tolerances: Sequence[float] | None = None
) -> list[dict[str, Any]]:
    """Settings to try, without the two references."""
    kind = kind_of(scene)
    steps = STEPS[kind] if steps is None else steps
    tolerances = TOLERANCES[kind] if tolerances is None else tolerances
    found: list[dict[str, Any]] = [
        {**({"step": step} if step else {}), "tolerance": tolerance}
        for step in (steps or (0.0,))
        for tolerance in tolerances
    ]
    if not isinstance(scene, Scene):
        return found
    other = [{"law": "rigid"}]
    if scene.grains.normal_stiffness is None:
        other = [{"law": f"compliant, kappa {kappa:g}"} for kappa in KAPPAS]
    middle = {"step": steps[len(steps) // 2], "tolerance": sorted(tolerances)[len(tolerances) // 2]}
    return found + [middle | law for law in other]


def _with_law(scene: Scene, law: str) -> Scene:
    """The scene with rigid contacts, or with compliant ones of a κ."""
    stiff = (
        None if law == "rigid" else float(law.rpartition(" ")[2]) * scene.triaxial.pressure * sum(scene.grains.radius)
    )
    return msgspec.structs.replace(scene, grains=msgspec.structs.replace(scene.grains, normal_stiffness=stiff))


_KINDS = {"triaxial": Scene, "motion": MotionScene, "slope": SlopeScene}


def prepared_sample(kind: str, scene: dict[str, Any]) -> dict[str, Any]:
    """The sample of a triaxial scene at rest at its pressure, as arrays."""
    from ..dem.preparation import make_sample, preparation
    from ..dem.run import walk

    whole = msgspec.convert(scene, _KINDS[kind])
    assert isinstance(whole, Scene)
    assembly = make_sample(whole.grains, whole.wires, whole.sample, whole.seed)
    for make in preparation(whole.grains, whole.wires, whole.sample, whole.solve, whole.triaxial.pressure):
        walk(make(assembly))
    return {"assembly": assembly.arrays()}


def one_run(kind: str, scene: dict[str, Any], setting: dict[str, Any], folder: Path) -> dict[str, Any]:
    """One setting: what the scene gave, processor seconds, contact iterations; or why it failed."""
    whole: AnyScene = msgspec.convert(scene, _KINDS[kind])
    start = None
    if kind == "triaxial":
        start = Assembly.from_arrays(load_run(folder / "sample.h5")[0]["assembly"])
    changed = with_setting(whole, setting)
    if isinstance(changed, Scene) and "law" in setting:
        changed = _with_law(changed, setting["law"])
    if isinstance(changed, MotionScene):
        frames = min(changed.motion.frames, FRAMES)
        changed = msgspec.structs.replace(changed, motion=msgspec.structs.replace(changed.motion, frames=frames))
    began = time.process_time()
    try:
        found = tested(changed, start)
    except FenchelError as problem:
        return {"seconds": time.process_time() - began, "failure": " ".join(str(problem).split())}
    return {"seconds": time.process_time() - began, "failure": "", **found}


def measure_scene(
    scene: AnyScene,
    folder: Path,
    *,
    measure: str | None = None,
    steps: Sequence[float] | None = None,
    tolerances: Sequence[float] | None = None,
    name: str = "scene",
    jobs: int | None = None,
    scheduler: str | None = None,
    show: bool = True,
) -> Front:
    """The front of a scene; runs are kept in `folder`, a second call takes them up.

    `measure` is one of those of the kind of scene (`fenchel.dem.accuracy.MEASURES`; default: the first). Errors of the others are among the
    figures. Raises `InputError` for an unknown measure and `ConvergenceError` where the references do not come to their end.
    """
    kind = kind_of(scene)
    known = measures_of(scene)
    measure = next(iter(known)) if measure is None else measure
    if measure not in known:
        raise InputError(f"measure = {measure!r}: of this scene it is one of {', '.join(known)}")
    tries = settings_of(scene, steps, tolerances)
    references = _references(tries)
    plain = msgspec.to_builtins(scene)
    tasks: list[Computation] = []
    if kind == "triaxial":
        tasks.append(Computation("sample", prepared_sample, folder, {"kind": kind, "scene": plain}))
    needs = tuple(task.name for task in tasks)
    for k, setting in enumerate([*references, *tries]):
        arguments = {"kind": kind, "scene": plain, "setting": setting}
        tasks.append(Computation(f"run {k}", one_run, folder, arguments, needs, cost=_cost(setting), in_folder=True))
    results = run_campaign(tasks, folder, jobs=jobs, scheduler=scheduler, show=show, label="trade-off")
    found = [results[f"run {k}"] for k in range(len(references) + len(tries))]
    for k in (0, 1):
        if found[k]["failure"]:
            raise ConvergenceError(
                f"{name}: the reference does not end ({found[k]['failure']}): nothing to measure against"
            )
    best, second, runs = found[0], found[1], found[2:]
    floors = {m: error_of(m, second, best) for m in known}
    points = [_measured(s, r, best, floors, measure) for s, r in zip(tries, runs, strict=True)]
    return Front(
        kind="scene",
        subject=name,
        measure=f"{measure}: {known[measure]}",
        cost="s of the processor",
        points=tuple(points),
        environment=environment(),
        note="two references differ by " + ", ".join(f"{floors[m]:.1e} in {m}" for m in known),
    )


def _references(tries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    finest: dict[str, Any] = {"tolerance": min(s["tolerance"] for s in tries) / 10.0}
    if "step" in tries[0]:
        finest["step"] = min(s["step"] for s in tries) / 2.0
    return [finest, finest | {"tolerance": 10.0 * finest["tolerance"]}]


def _cost(setting: Mapping[str, Any]) -> float:
    """A guess for the bars: small steps and tolerances take longer."""
    return float(setting["tolerance"] ** -0.2 * setting.get("step", 1.0) ** -0.5)


def _measured(
    setting: dict[str, Any], run: Mapping[str, Any], best: Mapping[str, Any], floors: Mapping[str, float], measure: str
) -> Measured:
    if run["failure"]:
        return Measured(setting=setting, cost=float(run["seconds"]), error=None, failure=str(run["failure"]))
    errors = {m: max(error_of(m, run, best), floor) for m, floor in floors.items()}
    return Measured(
        setting=setting,
        cost=float(run["seconds"]),
        error=errors[measure],
        figures={
            **errors,
            "residual": float(run["residual"]),
            "iterations": float(run["iterations"]),
            "steps": float(run["steps"]),
        },
    )


def read_any_scene(path: Path) -> AnyScene:
    """A scene file of any kind; `InputError` names file, key, rule and remedy in one line."""
    from ..dem.motion_scene import is_motion, read_motion_scene
    from ..dem.scene import read_scene
    from ..dem.slope_scene import is_slope, read_slope_scene

    if is_motion(path):
        return read_motion_scene(path)
    return read_slope_scene(path) if is_slope(path) else read_scene(path)
