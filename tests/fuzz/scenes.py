"""Random tiny scenes run to their end by the command line, and scenes with one thing wrong.

A valid scene (triaxial test, free bodies in two or three dimensions, slope) ends in a run file or in one line that says why not. Judged of
a run: every number finite, the residual that was recomputed within `PROMISED` of the tolerance of the sweeps, the energy of free bodies
accounted for (what went in, what was lost, what is left; the part that the run itself calls not accounted for is part of the sum), no body
gone to infinity, no file left beside the run; of a sample of them, that a run stopped on its way and resumed gives the same file, byte by
byte. An invalid scene is refused with exit code 2 and one line, and leaves nothing.
"""

from __future__ import annotations

import contextlib
import copy
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from fenchel.errors import FenchelError

from .case import Failure, command, digest_of, foreseen, pack

PLAIN = True
PROMISED = 3000.0
"""Residual over tolerance, or the limit of sweeps if that is more: sweeps stop on the change of impulses of one sweep, and a contraction
slow enough for that many sweeps (stacks, rigid chains) leaves as many times as much; never more than a tenth."""
STEPS = 400  # of a motion; a scene that asks for more, or for more bodies than `BODIES`, is only read
BODIES = 80
SHARED = ("rigid_rod", "elastic_rod", "rigid_wire", "elastic_wire")


# -- drawing --------------------------------------------------------------------------------------------------------------------------


def draw(seed: int) -> dict[str, Any]:
    """{"scene": nested dictionary, "wrong": what was changed or "", "resume": whether the run is stopped and taken up}."""
    rng = np.random.default_rng([seed, 2])
    scene = random_scene(rng)
    wrong = ""
    if rng.random() < 0.45:
        scene, wrong = spoiled(scene, rng)
    return {"scene": scene, "wrong": wrong, "resume": bool(rng.random() < 0.25)}


def digest(case: dict[str, Any]) -> str:
    """Of the whole."""
    return digest_of(pack(case))


def random_scene(rng: np.random.Generator) -> dict[str, Any]:
    """A valid scene."""
    kind = rng.choice(["triaxial", "motion", "slope"], p=[0.25, 0.6, 0.15])
    return {"triaxial": _triaxial, "motion": _motion, "slope": _slope}[str(kind)](rng)


def _size(rng: np.random.Generator, low: float, high: float) -> float:
    return float(f"{10.0 ** rng.uniform(low, high):.6g}")


def _friction(rng: np.random.Generator) -> float:
    return float(rng.choice([0.0, 0.1, 0.4, 1.0, 5.0]))


def _triaxial(rng: np.random.Generator) -> dict[str, Any]:
    r = _size(rng, -3.5, -2)
    pressure = _size(rng, 3, 6)
    grains: dict[str, Any] = {
        "count": int(rng.integers(22, 31)), "radius": [r, r * float(rng.choice([1.0, 1.3, 2.0]))], "friction": _friction(rng),
        "density": _size(rng, 2.5, 4),
    }  # fmt: skip
    if rng.random() < 0.8:
        grains["normal_stiffness"] = pressure * 2 * r * _size(rng, 1.8, 3.5)
    end = float(rng.choice([-2e-4, -5e-4, -1e-3, 5e-4]))
    path = [0.0, end] + ([end / 2] if rng.random() < 0.3 else [])
    scene: dict[str, Any] = {
        "seed": int(rng.integers(1000)), "grains": grains,
        "sample": {"solid_fraction": float(rng.choice([0.45, 0.5, 0.57])), "tolerance": 1e-3},
        "triaxial": {"pressure": pressure, "strain_path": path, "inertial_number": float(rng.choice([1e-2, 0.05, 0.1])),
                     "sphere": 0.98, "frame_strain": 1e-4},
        "solve": {"tolerance": float(rng.choice([1e-3, 1e-4, 1e-5])), "step": float(rng.choice([0.05, 0.2, 0.5])),
                  "sweep_limit": int(rng.choice([300, 3000, 20000]))},
    }  # fmt: skip
    if rng.random() < 0.4:
        scene["wires"] = {
            "law": str(rng.choice(SHARED)), "count": int(rng.integers(0, 4)), "beads": int(rng.integers(2, 6)), "spacing": 1.2 * r,
            "bead_radius": 0.4 * r, "stiffness": pressure * r**2 * _size(rng, 0, 4),
            "state": str(rng.choice(["stress_free", "prestressed"])), "control": False,
        }  # fmt: skip
    return scene


def _motion(rng: np.random.Generator) -> dict[str, Any]:
    d = int(rng.integers(2, 4))
    r = _size(rng, -3, -1)
    g = float(rng.choice([0.0, 9.81, 1000.0]))
    step = float(rng.choice([1e-4, 5e-4, 2e-3]))
    down = [0.0] * (d - 1)
    count = int(rng.integers(0, 21))
    side = max(2.1, 2.4 * float(np.ceil(count ** (1 / d)))) * r
    scene: dict[str, Any] = {
        "seed": int(rng.integers(1000)), "dimension": d,
        "motion": {"duration": step * int(rng.integers(1, 60)), "step": step, "gravity": [*down, -g],
                   "theta": float(rng.choice([0.5, 0.5, 0.75, 1.0])), "frames": int(rng.integers(1, 6))},
        "solve": {"tolerance": float(rng.choice([1e-3, 1e-5, 1e-8])), "sweep_limit": int(rng.choice([50, 2000, 20000]))},
        "plane": [{"normal": [*down, 1.0], "point": [0.0] * d, "friction": _friction(rng)}],
    }  # fmt: skip
    if count:
        scene["grains"] = {
            "count": count, "low": [0.0] * d, "high": [side] * (d - 1) + [3 * side], "radius": [0.8 * r, r],
            "density": _size(rng, 2, 4), "jitter": float(rng.choice([0.0, 0.1, 3.0])), "rotation": bool(rng.random() < 0.8),
        }  # fmt: skip
    if rng.random() < 0.4:
        scene["body"] = [
            {"position": [float(x) for x in rng.normal(size=d - 1) * 4 * r] + [(5.0 + 3.0 * k) * r + 3 * side], "radius": r,
             "velocity": [float(x) for x in rng.normal(size=d)], **({"mass": _size(rng, -6, 3)} if rng.random() < 0.8 else {})}
            for k in range(int(rng.integers(1, 3)))
        ]  # fmt: skip
    if rng.random() < 0.35:
        axis = int(rng.integers(d - 1))
        wall = {"normal": [float(i == axis) for i in range(d)], "point": [-r if i == axis else 0.0 for i in range(d)]}
        extra = str(rng.choice(["fixed", "velocity", "force", "pressure", "servo"]))
        if extra == "velocity":
            wall["velocity"] = [float(x) for x in 0.1 * rng.normal(size=d)]
        elif extra != "fixed":
            load = {"force": _size(rng, -3, 3)} if extra != "pressure" else {"pressure": _size(rng, 0, 5), "area": r**2}
            wall |= load | ({"mobility": _size(rng, -6, 0)} if extra == "servo" else {"mass": _size(rng, -4, 2)})
        scene["plane"].append(wall)
    if d == 3 and rng.random() < 0.2:
        scene["floor"] = {"radius": r, "low": [-2 * r, -2 * r], "high": [4 * r, 4 * r], "top": 0.0}
    if rng.random() < 0.35:
        scene["chain"] = [
            {"start": [float(x) for x in rng.normal(size=d - 1) * r] + [12.0 * r + 3 * side],
             "direction": [float(x) for x in rng.normal(size=d)], "beads": int(rng.integers(2, 8)), "spacing": 1.5 * r,
             "bead_radius": 0.5 * r, "bead_mass": _size(rng, -4, 0), "hung": str(rng.choice(["none", "first", "both"]))}
        ]  # fmt: skip
        scene["wire"] = {"law": str(rng.choice(SHARED)), "stiffness": _size(rng, 0, 5)}
    law = str(rng.choice(["signorini", "signorini_coulomb", "compliant_signorini_coulomb", "newton_restitution"]))
    scene["contact"] = {"law": law, "friction": _friction(rng)}
    if law == "compliant_signorini_coulomb":
        scene["contact"]["normal_stiffness"] = _size(rng, 2, 8)
    if law == "newton_restitution":
        scene["contact"]["restitution"] = float(rng.choice([0.0, 0.5, 1.0]))
    if rng.random() < 0.15:
        scene["motion"]["least_step"] = step / 16
    if rng.random() < 0.2:
        scene["motion"]["threads"] = 2
    return scene


def _slope(rng: np.random.Generator) -> dict[str, Any]:
    r = _size(rng, -3.5, -2)
    scene: dict[str, Any] = {
        "seed": int(rng.integers(1000)),
        "grains": {"count": int(rng.integers(10, 26)), "radius": [r, 1.5 * r], "friction": _friction(rng)},
        "slope": {"solid_fraction": 0.5, "rest": float(rng.choice([1e-2, 1e-1])), "reach": float(rng.choice([0.3, 1.0])),
                  "step_limit": int(rng.choice([20, 200])), "stiffness_factor": float(rng.choice([500.0, 2000.0]))},
        "solve": {"tolerance": 1e-2, "sweep_limit": int(rng.choice([30, 1000]))},
    }  # fmt: skip
    if rng.random() < 0.3:
        scene["wires"] = {
            "density": 0.3 / r**2, "beads": int(rng.integers(2, 6)), "law": str(rng.choice(SHARED)),
            "laying": str(rng.choice(["walks", "layers"])), "stiffness": _size(rng, 0, 3),
        }  # fmt: skip
    return scene


# -- one thing wrong ------------------------------------------------------------------------------------------------------------------

BAD: tuple[Any, ...] = (
    -1.0, 0.0, -1, "", "x", [], {}, True, [1.0], [[1.0]], 1e300, -1e300, 5e-324, float("nan"), float("inf"), 10**18, "\u0000",
    [float("nan")] * 3,
    {"x": 1}, [0.0, 0.0, 0.0], [0.0, 0.0], "rigid_rod ",
)  # fmt: skip


def places(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all keys and items."""
    found: list[tuple[Any, ...]] = []
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        found += [(*at, key), *places(item, (*at, key))]
    return found


def spoiled(scene: dict[str, Any], rng: np.random.Generator) -> tuple[dict[str, Any], str]:
    """The scene with one value replaced, one key taken out, renamed or added."""
    found = copy.deepcopy(scene)
    where = places(found)
    path = where[int(rng.integers(len(where)))]
    inner = found
    for key in path[:-1]:
        inner = inner[key]
    way = str(rng.choice(["value", "value", "value", "out", "rename", "add"]))
    shown = ".".join(map(str, path))
    if way == "value" or isinstance(inner, list):
        value = BAD[int(rng.integers(len(BAD)))]
        inner[path[-1]] = value
        return found, f"{shown} = {value!r}"
    if way == "out":
        del inner[path[-1]]
    elif way == "rename":
        inner[path[-1] + "s"] = inner.pop(path[-1])
    else:
        inner["colour"] = "red"
    return found, f"{way} {shown}"


def toml_of(value: dict[str, Any]) -> str:
    """TOML text of a nested dictionary; tables inline, so that any value can stand anywhere."""
    return "\n".join(f"{_key(k)} = {_toml(v)}" for k, v in value.items()) + "\n"


def _key(text: str) -> str:
    return text if text.replace("_", "").isalnum() and text.isascii() else _toml(text)


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + "".join(c if c.isprintable() and c not in '"\\' else f"\\u{ord(c):04x}" for c in value) + '"'
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    return repr(value)


# -- judging --------------------------------------------------------------------------------------------------------------------------


def judge(case: dict[str, Any]) -> str:
    """See the module."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file, run = folder / "scene.toml", folder / "run.h5"
        file.write_text(toml_of(case["scene"]), encoding="utf-8")
        reason = small(file)
        if reason == "large":
            return "accepted, too large to run"
        code, _, said = command("dem", str(file), "-o", str(run), "--quiet", "--json")
        left = sorted(p.name for p in folder.iterdir())
        if code == 2:
            # whether a sample of this density and these wires can be made shows when it is made
            if not case["wrong"] and "cannot be reached" not in said and "does not fit" not in said:
                raise Failure(f"a valid scene is refused: {said}")
            if left != ["scene.toml"]:
                raise Failure(f"a refused scene leaves {left}")
            return "refused (InputError)"
        if set(left) - {"scene.toml", "run.h5"}:
            raise Failure(f"files are left beside the run: {left}")
        if code == 1:
            if len(said.splitlines()) != 1:
                raise Failure(f"a run fails with more than one line: {said[-300:]!r}")
            return "stopped (ConvergenceError)"
        if reason:
            raise Failure(f"a scene that its reader refuses ({reason}) runs")
        judge_run(case, run)
        if case["resume"]:
            resumed(file, run, folder)
        return "answer, resumed" if case["resume"] else "answer"


def small(file: Path) -> str:
    """ "" if the scene is read and small, "large", or the words with which its reader refuses it."""
    from fenchel.dem.motion_scene import bodies_of, is_motion, read_motion_scene
    from fenchel.dem.scene import read_scene
    from fenchel.dem.slope_scene import is_slope, read_slope_scene

    try:
        if is_motion(file):
            scene = read_motion_scene(file)
            beads = sum(c.beads for c in scene.chain) + (scene.grains.count if scene.grains else 0)
            floor = scene.floor
            if floor is not None:
                area = abs((floor.high[0] - floor.low[0]) * (floor.high[1] - floor.low[1]))
                beads += int(min(area / floor.radius**2, 1e9)) if floor.radius > 1e-150 else 10**9
            if (
                scene.motion.duration / (scene.motion.least_step or scene.motion.step) > 16 * STEPS
                or beads > 4 * BODIES
            ):
                return "large"
            bodies_of(scene)
        elif is_slope(file):
            scene = read_slope_scene(file)
            wires = scene.wires
            beads = 0 if wires is None else wires.density * wires.beads * (scene.grains.radius[1] * 4) ** 2
            if scene.grains.count > BODIES or beads > 1000 or scene.slope.step_limit > 2000:
                return "large"
        else:
            scene = read_scene(file)
            path = scene.triaxial.strain_path
            strain = sum(abs(a - b) for a, b in zip(path[1:], path[:-1], strict=True))
            steps = strain / scene.triaxial.inertial_number / scene.solve.step
            beads = 0 if scene.wires is None else scene.wires.count * scene.wires.beads
            if scene.grains.count + beads > BODIES or steps > 5 * STEPS or scene.sample.tolerance < 1e-6:
                return "large"
    except FenchelError as error:
        foreseen(error)
        return str(error)
    return ""


def finite(value: Any, at: str = "") -> list[str]:
    """Names of everything that is not finite."""
    if isinstance(value, dict):
        return [n for k, v in value.items() for n in finite(v, f"{at}/{k}")]
    if isinstance(value, (float, np.floating)) or (isinstance(value, np.ndarray) and value.dtype.kind == "f"):
        return [] if np.isfinite(value).all() else [at]
    return []


# what has no value: the width of no box, masses and radii of fixed bodies, the slope of a heap too small to have one, κ of rigid grains
MAY_BE_INFINITE = ("half", "mass", "angle", "reach", "height", "low", "kappa", "deflection", "start_half", "inertia")


def judge_run(case: dict[str, Any], run: Path) -> None:
    """Numbers of a finished run file."""
    from fenchel.dem.storage import load_run

    content, _ = load_run(run)
    bad = [n for n in finite(content) if not any(word in n.rsplit("/", 1)[-1] for word in MAY_BE_INFINITE)]
    if bad:
        raise Failure(f"a finished run holds numbers that are not finite: {', '.join(bad[:6])}")
    quality = content.get("quality") or content["record"].get("quality", {})
    scene = case["scene"]
    tolerance = scene.get("solve", {}).get("tolerance", 1e-5)
    worst = quality.get("natural_map_max", 0.0)
    # a scene that was spoilt and still runs (a gravity of 1e18 m/s²) promises no contraction of its sweeps
    allowed = min(0.1, tolerance * max(PROMISED, scene.get("solve", {}).get("sweep_limit", 0)))
    if not case["wrong"] and not worst <= max(allowed, 1e-12):
        raise Failure(f"a step ends at natural map {worst:.2e} where sweeps stop at {tolerance:.0e}")
    # what moves a body of infinite mass is in no term of the energy
    driven = any("mass" not in body and any(body.get("velocity", ())) for body in scene.get("body", ()))
    if "frames" in content and "external" in quality and not driven:
        energies(content, quality)


def energies(content: dict[str, Any], quality: dict[str, float]) -> None:
    """From the first stored frame to the last: Δ(kinetic + elastic) + losses − work = what the run calls its balance."""
    f = content["frames"]
    names = ("friction", "algorithmic", "shock", "damping")
    held = f["kinetic"] + f["elastic"]
    lost = sum(f[n] for n in names)
    if len(held) < 2:
        return
    change = (held[-1] - held[0]) + (lost[-1] - lost[0]) - (f["external"][-1] - f["external"][0])
    known = f["balance"][-1] - f["balance"][0]
    size = np.abs(held).max() + np.abs(lost).max() + np.abs(f["external"]).max() + np.abs(f["balance"]).max()
    error = min(abs(change - known), abs(change + known))
    if not error <= 1e-6 * size:
        raise Failure(
            f"energies do not add up: {error:.2e} J of {size:.2e} J are neither kept, lost nor told as balance"
        )


def resumed(file: Path, run: Path, folder: Path) -> None:
    """Stopped after the first step and after about half, then resumed: the same bytes."""
    from fenchel.dem.motion import run_motion
    from fenchel.dem.motion_scene import is_motion
    from fenchel.dem.run import run_scene
    from fenchel.dem.slope_scene import is_slope, run_slope

    class Stop(Exception):
        pass

    go = run_motion if is_motion(file) else run_slope if is_slope(file) else run_scene
    again = folder / "again.h5"
    for share in (0.0, 0.5):

        def watch(progress: Any, share: float = share) -> None:
            if progress.fraction >= share:
                raise Stop

        with contextlib.suppress(Stop):
            go(file, again, resume=True, progress=watch, every=0.0)
    go(file, again, resume=True)
    if run.read_bytes() != again.read_bytes():
        raise Failure("a run that was stopped and resumed ends in another file than one that was not")
