r"""A scene for a wanted accuracy: which step and tolerance, known from scenes like it.

What a scene is made for is its *measure*: the stress of a triaxial test, the place of free bodies, the angle of a deposit.
`accuracy = 1e-2` in a scene asks for its first measure to one per cent of its largest value. Step and tolerance then come from the front
that `fenchel tradeoff dem` kept for the scene on this machine, else from tests of random scenes that are shipped: the logarithm of their
errors is fitted over those of step, tolerance, stiffness κ, inertial number and the like, and the cheapest setting is taken whose error,
with the margin that 98 % of the tested scenes stay below when each is predicted from the others, does not exceed the accuracy. Some scenes
are so sensitive that no setting has it: how many of the scenes alike can be told beforehand, which ones only by measuring. After the run
the residual is held against the largest of the tested scenes.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from ..cache import content_hash
from ..errors import InputError
from ..front import checked_accuracy, kept_front, shipped_front
from .bodies import Assembly
from .measures import Network
from .motion_scene import MotionScene, bodies_of
from .scene import Scene
from .slope_scene import SlopeScene

__all__ = [
    "MEASURES", "SceneChoice", "choose", "error_of", "features", "kind_of", "measures_of", "resolved", "scene_key", "tested",
    "with_setting",
]  # fmt: skip

Array = NDArray[np.float64]
AnyScene = Scene | MotionScene | SlopeScene
MEASURES = {
    "triaxial": {
        "stress": "deviator along the path, root mean square over the largest",
        "strain": "volume strain along the path, root mean square over the largest",
        "porosity": "1 − solid fraction at the end, relative",
        "length": "longest active segment of the wires at the end, relative",
    },
    "motion": {
        "centre": "centre of mass of the free bodies, largest over the time, relative to how far it moves",
        "energy": "energy lost, largest over the time, relative to its largest",
    },
    "slope": {
        "angle": "angle of repose, relative",
        "height": "height of the heap, relative",
    },
}
ROWS = 60  # of a path at which curves are compared
SWEEP_LIMIT = 50_000  # of a step at least, so that it is the tolerance that stops the sweeps


def kind_of(scene: AnyScene) -> str:
    """triaxial, motion or slope."""
    return {Scene: "triaxial", MotionScene: "motion", SlopeScene: "slope"}[type(scene)]


def measures_of(scene: AnyScene) -> dict[str, str]:
    """The measures of a scene by name, the one that `accuracy` means first."""
    found = dict(MEASURES[kind_of(scene)])
    if isinstance(scene, Scene) and (scene.wires is None or scene.wires.count == 0):
        del found["length"]
    return found


# -- what a scene gives --------------------------------------------------------------------------------------------------------


def tested(scene: AnyScene, start: Assembly | None = None) -> dict[str, Any]:
    """Run a scene without a run file and return what `error_of` compares; of a triaxial scene the test of the prepared sample `start`."""
    if isinstance(scene, Scene):
        assert start is not None
        return _triaxial(scene, start)
    return _motion(scene) if isinstance(scene, MotionScene) else _slope(scene)


def _triaxial(scene: Scene, start: Assembly) -> dict[str, Any]:
    from .run import triaxial_stage, walk

    test = triaxial_stage(start, scene.grains, scene.wires, scene.triaxial, scene.solve, scene.triaxial.pressure)
    walk(test)
    record = test.record(seed=scene.seed, settings={})
    stress, strain = record.wall_stress, record.wall_strain
    return {
        "along": np.concatenate([[0.0], np.cumsum(np.abs(np.diff(record.axial_strain)))]),
        "stress": stress[:, 2] - 0.5 * (stress[:, 0] + stress[:, 1]),
        "strain": strain[:, :3].sum(axis=1),
        "porosity": 1.0 - record.quality["solid_fraction"],
        "length": _length(start, scene),
        "residual": record.quality["natural_map_max"],
        "iterations": record.quality["contact_iterations"],
        "steps": record.quality["steps"],
    }


def _length(assembly: Assembly, scene: Scene) -> float:
    if scene.wires is None or not len(assembly.links):
        return math.nan
    from .measures import active_length

    return active_length(Network.of_assembly(assembly, friction=scene.grains.friction, bead_friction=None)).length


def _motion(scene: MotionScene) -> dict[str, Any]:
    from .motion import MotionStage
    from .run import walk

    stage = MotionStage(bodies_of(scene), scene)
    mass = stage.assembly.mass
    free = np.isfinite(mass)
    weight = np.where(free, mass, 0.0) / max(float(mass[free].sum()), np.finfo(float).tiny)
    first = weight @ stage.assembly.x
    walk(stage)
    frames = stage.frames
    lost = np.array(
        [
            sum(frames[name][k] for name in ("friction", "algorithmic", "shock", "damping"))
            for k in range(len(frames["time"]))
        ]
    )
    return {
        "along": np.array(frames["time"]),
        "centre": np.array([weight @ x for x in frames["x"]]) - first,
        "energy": lost,
        "residual": stage.worst,
        "iterations": float(stage.simulation.total_rows),
        "steps": float(stage.steps),
    }


def _slope(scene: SlopeScene) -> dict[str, Any]:
    from .run import walk
    from .slope_scene import deposit_of, quality_of, repose_of, start_of

    stage = deposit_of(scene, start_of(scene))
    walk(stage)
    quality = quality_of(stage, repose_of(stage, scene))
    return {
        "angle": quality["angle"],
        "height": quality["height"],
        "residual": quality["natural_map_max"],
        "iterations": quality["contact_iterations"],
        "steps": quality["steps"],
    }


def error_of(measure: str, found: Mapping[str, Any], best: Mapping[str, Any]) -> float:
    """The error of a measure against the reference, as `MEASURES` says."""
    one, other = np.asarray(found[measure], dtype=float), np.asarray(best[measure], dtype=float)
    if one.ndim == 0:
        return float(abs(one - other) / max(abs(float(other)), np.finfo(float).tiny))
    x = np.linspace(0.0, min(found["along"][-1], best["along"][-1]), ROWS + 1)[1:]
    a, b = _at(x, found["along"], one), _at(x, best["along"], other)
    size = max(float(np.linalg.norm(b, axis=1).max(initial=0.0)), np.finfo(float).tiny)
    apart = np.linalg.norm(a - b, axis=1)
    if measure in ("stress", "strain"):
        return float(np.sqrt(np.mean(apart**2))) / size
    return float(apart.max(initial=0.0)) / size


def _at(x: Array, along: Any, values: Array) -> Array:
    columns = values.reshape(len(values), -1)
    return np.stack([np.interp(x, np.asarray(along), column) for column in columns.T], axis=1)


# -- what is chosen ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SceneChoice:
    """`setting` (step, tolerance) for `accuracy` of `measure`; `expected` error; `residual` up to which the run is as those that it was
    learnt from (nan: unknown); in words where it comes from."""

    accuracy: float
    measure: str
    setting: Mapping[str, float]
    expected: float
    residual: float
    source: str
    why: str

    def __str__(self) -> str:
        return self.why

    def confirmed(self, residual: float) -> bool | None:
        """Whether a finished run is one of the kind that the choice was made from; None where that is not known."""
        return None if math.isnan(self.residual) else residual <= self.residual

    def as_dict(self) -> dict[str, Any]:
        """As plain numbers and words."""
        return {
            "accuracy": self.accuracy,
            "measure": self.measure,
            "setting": dict(self.setting),
            "expected": self.expected,
            "residual": None if math.isnan(self.residual) else self.residual,
            "source": self.source,
            "why": self.why,
        }


def scene_key(scene: AnyScene) -> str:
    """Key of a scene's front in the user's cache: everything but the seed, the accuracy and the solver's settings."""
    content = msgspec.to_builtins(scene)
    for name in ("seed", "accuracy", "solve"):
        content.pop(name, None)
    if isinstance(scene, MotionScene):
        content["motion"].pop("frames", None)
    return content_hash(str(sorted(content.items())))


def features(scene: Scene) -> dict[str, float]:
    """What a triaxial scene has that matters to step and tolerance."""
    stiff = scene.grains.normal_stiffness
    kappa = 1e6 if stiff is None else stiff / (scene.triaxial.pressure * sum(scene.grains.radius))
    walked = float(np.abs(np.diff(scene.triaxial.strain_path)).sum())
    return {
        "kappa": math.log10(kappa),
        "inertial": math.log10(scene.triaxial.inertial_number),
        "friction": scene.grains.friction,
        "size": math.log10(scene.grains.count),
        "wires": float(scene.wires is not None and scene.wires.count > 0),
        "walked": math.log10(walked),
    }


# at which likeness fades: decades, and of friction and wires their own size
WIDTHS = {"kappa": 0.5, "inertial": 0.4, "friction": 0.3, "size": 0.5, "wires": 0.35, "walked": 0.5}
SHARE = 0.98  # of the tested scenes, each predicted from the others, whose error is below what the margin allows
UNLIKE = 1e-2  # scenes' worth of likeness below which nothing is known
RARE = 0.1  # share of the scenes like it that can have an accuracy at all, below which it is refused
RIDGE = 0.3
FLOOR = 3.0  # times the least error of a scene: below, it is chaos and not the setting that is measured


def choose(scene: AnyScene) -> SceneChoice:
    """Step and tolerance for the scene's `accuracy`. `InputError` where nothing is known, or the accuracy is not to be had."""
    accuracy = checked_accuracy(scene.accuracy)
    measure = next(iter(measures_of(scene)))
    kept = kept_front("scene", scene_key(scene))
    if kept is not None:
        front = replace(kept, points=tuple(p for p in kept.points if "law" not in p.setting))
        best = front.cheapest(accuracy)
        if best is None:
            raise InputError(
                f"accuracy = {accuracy:g}: the front measured for this scene ends at {front.finest:.1e}: ask for that, or for more grains"
            )
        source = "the front measured on this machine for this scene"
        residual = 10.0 * float(best.figures.get("residual") or math.nan)
        return _choice(accuracy, measure, dict(best.setting), float(best.error or 0.0), residual, source, "")
    if not isinstance(scene, Scene):
        raise InputError(
            f"accuracy = {accuracy:g}: nothing is shipped for scenes of this kind; "
            "measure this one once: fenchel tradeoff dem SCENE.toml -o DIR"
        )
    return _from_shipped(scene, accuracy, measure)


def likeness(one: Mapping[str, float], other: Mapping[str, float]) -> float:
    """1 for scenes alike, falling to 0: exp(−½ Σ (Δ/width)²)."""
    return math.exp(-0.5 * sum(((one[k] - other[k]) / w) ** 2 for k, w in WIDTHS.items()))


@dataclass(frozen=True)
class _Model:
    """log₁₀ of error and of relative cost, quadratic in the logarithms of step, tolerance, κ and inertial number and linear in the rest;
    `margin` [decades] that 98 % of the scenes, each predicted from the others, stay below."""

    error: Array
    cost: Array
    margin: float


def _terms(here: Mapping[str, float], setting: Mapping[str, float]) -> Array:
    t, h = math.log10(setting["tolerance"]) + 4.0, math.log10(setting["step"]) + 1.15
    k, i = here["kappa"] - 3.0, here["inertial"] + 3.2
    rest = (here["friction"] - 0.5, here["size"] - 2.2, here["wires"], here["walked"] + 2.0)
    return np.array([1.0, t, h, t * t, h * h, t * h, k, i, *rest, t * k, t * i, h * k, h * i, k * i, k * k, i * i])


def _fitted(terms: Array, values: Array) -> Array:
    return np.asarray(
        np.linalg.solve(terms.T @ terms + RIDGE * np.eye(terms.shape[1]), terms.T @ values), dtype=np.float64
    )


def fit_model(shipped: Mapping[str, Any]) -> _Model:
    """The model of shipped fronts; its margin by leaving one scene out at a time."""
    terms, errors, costs, scene, clear = [], [], [], [], []
    for n, row in enumerate(shipped["scenes"]):
        least = min(e for e in row["errors"] if e is not None)
        cheapest = min(c for c in row["seconds"] if c is not None)
        for setting, error, seconds in zip(shipped["settings"], row["errors"], row["seconds"], strict=True):
            if error is None:
                continue
            terms.append(_terms(row["features"], setting))
            errors.append(math.log10(max(error, 1e-12)))
            costs.append(math.log10(seconds / cheapest))
            scene.append(n)
            clear.append(error > FLOOR * least)
    a, e, c, of, told = np.array(terms), np.array(errors), np.array(costs), np.array(scene), np.array(clear)
    left = []
    for n in np.unique(of):
        others, own = told & (of != n), told & (of == n)
        left.append(e[own] - a[own] @ _fitted(a[others], e[others]))
    return _Model(_fitted(a[told], e[told]), _fitted(a, c), float(np.quantile(np.concatenate(left), SHARE)))


@functools.cache
def _model() -> _Model:
    return fit_model(shipped_front("scene"))


def predicted(
    shipped: Mapping[str, Any], model: _Model, here: Mapping[str, float], accuracy: float
) -> tuple[dict[str, float], float, float, float, float]:
    """(setting, its expected error, largest residual met under it, share of scenes like it that can have the accuracy, likeness).

    The cheapest setting whose predicted error with the margin does not exceed the accuracy, else the one with the least predicted error.
    """
    settings = shipped["settings"]
    terms = np.array([_terms(here, setting) for setting in settings])
    error, cost = terms @ model.error, terms @ model.cost
    good = error + model.margin <= math.log10(accuracy)
    k = int(np.argmin(np.where(good, cost, np.inf))) if good.any() else int(np.argmin(error))
    rows = shipped["scenes"]
    weights = np.array([likeness(here, row["features"]) for row in rows])
    able = np.array([any(e is not None and e <= accuracy for e in row["errors"]) for row in rows])
    residual = max((row["residuals"][k] for row in rows if row["residuals"][k] is not None), default=math.nan)
    whole = float(weights.sum())
    share = float(weights @ able) / whole if whole > 0.0 else 0.0
    return dict(settings[k]), float(10.0 ** error[k]), float(residual), share, whole


def _from_shipped(scene: Scene, accuracy: float, measure: str) -> SceneChoice:
    shipped = shipped_front("scene")
    setting, error, residual, able, whole = predicted(shipped, _model(), features(scene), accuracy)
    if whole < UNLIKE:
        raise InputError(
            f"accuracy = {accuracy:g}: no tested scene is like this one; measure it once: fenchel tradeoff dem SCENE.toml -o DIR"
        )
    if able < RARE:
        raise InputError(
            f"accuracy = {accuracy:g}: in {1.0 - able:.0%} of the scenes like this one no setting had it, two references differed by more; "
            "ask for less, or take more grains"
        )
    source = f"{len(shipped['scenes'])} tested random scenes"
    words = f"expected error {error:.0e}; {able:.0%} of the scenes like it can have {accuracy:g} at all, the others are too sensitive"
    return _choice(accuracy, measure, setting, error, residual, source, words)


def _choice(
    accuracy: float, measure: str, setting: dict[str, Any], expected: float, residual: float, source: str, words: str
) -> SceneChoice:
    text = ", ".join(f"{k} {v:g}" for k, v in setting.items())
    why = f"{text} for {measure} to {accuracy:g}: from {source}" + (f"; {words}" if words else "")
    return SceneChoice(accuracy, measure, setting, expected, residual, source, why)


def resolved(scene: AnyScene, run_file: Path | str) -> tuple[AnyScene, dict[str, Any]]:
    """(the scene as it is run, {"accuracy": the choice} or {}): a run that goes on keeps the choice with which it began."""
    if scene.accuracy is None:
        return scene, {}
    if Path(run_file).exists():
        from .storage import load_run

        before = load_run(run_file)[1].get("accuracy")
        if before is not None and before.get("accuracy") == scene.accuracy:
            residual = math.nan if before["residual"] is None else before["residual"]
            choice = SceneChoice(**(before | {"residual": residual}))
            return with_setting(scene, choice.setting), {"accuracy": choice.as_dict()}
    choice = choose(scene)
    return with_setting(scene, choice.setting), {"accuracy": choice.as_dict()}


def with_setting(scene: AnyScene, setting: Mapping[str, Any]) -> AnyScene:
    """The scene with another tolerance, and step (of a motion times its own); with as many sweeps as it was measured with."""
    change = msgspec.structs.replace
    solve = change(scene.solve, tolerance=setting["tolerance"])
    if isinstance(scene, SlopeScene):
        return change(scene, solve=solve)
    solve = change(solve, sweep_limit=max(SWEEP_LIMIT, scene.solve.sweep_limit))
    if isinstance(scene, MotionScene):
        return change(scene, solve=solve, motion=change(scene.motion, step=scene.motion.step * setting["step"]))
    return change(scene, solve=change(solve, step=setting["step"]))
