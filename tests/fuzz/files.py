"""Damaged files of every kind that is read: paths, parameters, scenes, studies, law files, FCLIB problems, run files and checkpoints.

A good file of a kind is damaged in some bytes, lines, cells or words; whoever reads it answers or says in one line why not, and leaves no
file of its own behind. Law files are Python and run as such: they are put together of words of the language and numbers alone, and what is
damaged is the order, the number and the kind of these words.

The damaged bytes are the case, so that its line does not depend on how they were drawn.
"""

from __future__ import annotations

import base64
import contextlib
import functools
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from fenchel.errors import FenchelError

from .case import Failure, command, digest_of, foreseen, pack
from .scenes import small

PLAIN = True
KINDS = (
    "path",
    "path",
    "parameters",
    "scene",
    "motion",
    "slope",
    "study",
    "law",
    "law",
    "fclib",
    "fclib",
    "run",
    "checkpoint",
)

PATH = "t,eps_zz,eps_xy,sig_xx,sig_yy\n0,0,0,0,0\n1,-1e-3,2e-4,0,-1e4\n2,-2e-3,1e-4,0,-1e4\n3,-1e-3,0,0,0\n"
OTHER_PATHS = (
    "t,eps_v,eps_xy,T\n0,0,0,300\n0.5,1e-3,2e-4,310\n1,2e-3,0,290\n",
    "\ufefft, p ,eps_zz\r\n0,0,0\r\n\r\n1,1e4,-1e-3\r\n2,2e4,-2e-3\r\n",
    "t\n0\n1\n2\n",
)
PARAMETERS = "E = 2e11\nnu = 0.3\nsigma_y = 3e8\n\n# hardening\nH_k = 0\nH_i = 1_000_000_000.0\n"
SCENE = """seed = 3
[grains]
count = 24
radius = [1e-3, 1.3e-3]
friction = 0.4
normal_stiffness = 4.3e4
[wires]
law = "elastic_wire"
count = 2
beads = 4
[sample]
solid_fraction = 0.5
tolerance = 1e-3
[triaxial]
pressure = 5e4
strain_path = [0.0, -1e-3]
inertial_number = 0.1
sphere = 0.98
[solve]
step = 0.5
tolerance = 1e-3
"""
MOTION = """seed = 1
dimension = 2
[motion]
duration = 5e-3
step = 1e-3
gravity = [0.0, -9.81]
frames = 2
[grains]
count = 6
low = [0.0, 0.0]
high = [0.06, 0.2]
radius = [4e-3, 6e-3]
[[plane]]
normal = [0.0, 1.0]
point = [0.0, 0.0]
friction = 0.3
[[body]]
position = [0.03, 0.3]
radius = 5e-3
mass = 0.1
"""
SLOPE = """seed = 1
[grains]
count = 12
sizes = "sieve"
opening = [1e-3, 2e-3]
passing = [0.0, 1.0]
[slope]
rest = 0.1
step_limit = 30
[solve]
tolerance = 1e-2
"""
STUDY = """[grains]
count = 1000
radius = [0.75e-3, 1.39e-3]
normal_stiffness = 4.3e4
[wires]
law = "elastic_wire"
[triaxial]
pressures = [5e4, 7e4, 9e4]
held_out = [6e4]
strain_path = [0.0, -0.01, 0.006, -0.01]
[solve]
seeds = [1, 2]
[identify]
yield_offset = 2e-4
"""
LAW_HEAD = """from sympy import Rational, exp, log, sqrt
from fenchel.potentials import *
E, nu, k, H, eta, n = parameters("E nu k H eta n")
eps, eps_p, x, p, v, T = sym_tensor("eps"), sym_tensor("eps_p"), sym_tensor("x"), scalar("p"), vector("v"), temperature("T")
A, X, R = forces(eps_p, x, p)
rate = rates(eps_p)
"""
LAWS = (
    "law = Law ( 'law' , psi = isotropic ( E , nu ) . energy ( eps - eps_p ) + H / 2 * p ** 2 , "
    "phi_star = indicator ( norm ( dev ( A ) ) + R - k ) , observable = eps , internal = ( eps_p , p ) )",
    "law = Law ( 'law' , psi = isotropic ( E , nu ) . energy ( eps - eps_p ) + H / 2 * inner ( x , x ) , "
    "phi_star = k * pos ( norm ( dev ( A + X ) ) / k - 1 ) ** ( n + 1 ) / eta , observable = eps , internal = ( eps_p , x ) )",
    "law = Law ( 'law' , psi = E / 2 * inner ( eps - eps_p , eps - eps_p ) , phi = k * norm ( rate ) + eta / 2 * "
    "inner ( rate , rate ) , observable = eps , internal = ( eps_p , ) )",
    "law = Law ( 'law' , psi = E / 2 * inner ( pos ( eps ) , pos ( eps ) ) + H / 2 * pos ( tr ( eps ) ) ** 2 , observable = eps )",
    "law = Law ( 'law' , psi = isotropic ( E , nu ) . energy ( eps - eps_p ) - eta * ( T - 300 ) * tr ( eps ) , phi_star = "
    "indicator ( eig_max ( A ) - eig_min ( A ) - k , tr ( A ) - 3 * k ) , observable = eps , internal = ( eps_p , ) )",
)
WORDS = """
E nu k H eta n eps eps_p x p v T A X R rate 0 1 2 -1 0.5 1e300 1e-300 + - * / ** ( ) , . [ ] = < 'law' None True dev
norm inner tr pos eig_max eig_min exp log sqrt Rational indicator forces rates frozen sym_tensor scalar energy Law psi
phi phi_star observable internal density insist note name identity lambda : not and
""".split()  # noqa: SIM905


# -- drawing --------------------------------------------------------------------------------------------------------------------------


def draw(seed: int) -> dict[str, Any]:
    """{"kind", "bytes" in base64}."""
    rng = np.random.default_rng([seed, 3])
    kind = str(rng.choice(KINDS))
    data = {"law": _law, "fclib": _fclib, "run": _run, "checkpoint": _checkpoint}.get(kind, _text)(rng, kind)
    return {"kind": kind, "bytes": base64.b64encode(data).decode()}


def digest(case: dict[str, Any]) -> str:
    """Of the whole."""
    return digest_of(pack(case))


def _text(rng: np.random.Generator, kind: str) -> bytes:
    good = {"parameters": PARAMETERS, "scene": SCENE, "motion": MOTION, "slope": SLOPE, "study": STUDY}.get(kind, PATH)
    if kind == "path" and rng.random() < 0.5:
        good = str(rng.choice(list(OTHER_PATHS)))
    return damaged_text(good, rng) if rng.random() < 0.7 else damaged(good.encode(), rng)


PIECES = (
    "nan", "inf", "-inf", "1e309", "-1", "0", "1e-320", "", ",", ";", "\n", "\x00", "é", "=", "[", "]", "\"",
    "'", "#", "[[", "true", "T", "t", "\t",
    "0x10", "1_0", "1979-05-27", "9" * 400, "eps_xx", "sig_zz", "p", "eps_v", "{", "}", ".", "'''", "\r", "\ufeff", "1e", "--", "١",
)  # fmt: skip


def damaged_text(text: str, rng: np.random.Generator) -> bytes:
    """Lines and words swapped, doubled, lost or replaced."""
    for _ in range(int(rng.integers(1, 4))):
        lines = text.splitlines(keepends=True) or [""]
        way, i, j = int(rng.integers(6)), int(rng.integers(len(lines))), int(rng.integers(len(lines)))
        if way == 0:
            lines[i], lines[j] = lines[j], lines[i]
        elif way == 1:
            lines.insert(i, lines[j])
        elif way == 2:
            del lines[i]
        else:
            at = int(rng.integers(len(lines[i]) + 1))
            end = min(len(lines[i]), at + int(rng.integers(0, 6)))
            lines[i] = lines[i][:at] + str(rng.choice(PIECES)) + lines[i][end:]
        text = "".join(lines)
    return text.encode("utf-8", "surrogatepass")


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """Bytes flipped, cut, doubled, replaced by runs of one byte."""
    found = bytearray(data)
    for _ in range(int(rng.integers(1, 6))):
        if not found:
            break
        at, way = int(rng.integers(len(found))), int(rng.integers(6))
        length = int(min(2.0 ** rng.uniform(0, 10), len(found) - at))
        if way == 0:
            found[at] ^= 1 << int(rng.integers(8))
        elif way == 1:
            found[at] = int(rng.integers(256))
        elif way == 2:
            del found[at : at + length]
        elif way == 3:
            found[at:at] = found[at : at + length]
        elif way == 4:
            found[at : at + length] = bytes([int(rng.choice([0, 255, 65]))]) * length
        else:
            del found[at:]
    return bytes(found)


def _law(rng: np.random.Generator, kind: str) -> bytes:
    words = str(rng.choice(LAWS)).split()
    for _ in range(int(rng.integers(0, 4))):
        i, way = int(rng.integers(3, len(words))), int(rng.integers(4))
        if way == 0:
            words[i] = str(rng.choice(WORDS))
        elif way == 1:
            words.insert(i, str(rng.choice(WORDS)))
        elif way == 2:
            del words[i]
        else:
            j = int(rng.integers(3, len(words)))
            words[i], words[j] = words[j], words[i]
        if len(words) < 5:
            break
    return (LAW_HEAD + " ".join(words) + "\n").encode()


@functools.cache
def _good_fclib(kind: int) -> bytes:
    import h5py
    from contact_families import boxes, wedge

    from fenchel.dem.one_step import OneStepProblem, write_fclib

    problem = OneStepProblem.of_bodies(**(wedge(0.3) if kind else boxes(2)))
    if kind == 2:
        problem = OneStepProblem.local(problem.delassus, problem.q, problem.mu, title="two")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "problem.hdf5"
        write_fclib(problem, file)
        if kind == 2:  # triplets
            with h5py.File(file, "r+") as open_file:
                node = open_file["fclib_local/W"]
                full = problem.delassus.tocoo()
                for key in ("p", "i", "x", "nz"):
                    del node[key]
                node["nz"] = np.array([full.nnz], dtype=np.int32)
                node["p"], node["i"], node["x"] = full.col.astype(np.int32), full.row.astype(np.int32), full.data
        return file.read_bytes()


def _fclib(rng: np.random.Generator, kind: str) -> bytes:
    """Bytes damaged, or whole entries of a sound HDF5 file replaced: only the second is ours to read carefully."""
    import h5py

    good = _good_fclib(int(rng.integers(3)))
    if rng.random() < 0.4:
        return damaged(good, rng)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "problem.hdf5"
        file.write_bytes(good)
        with h5py.File(file, "r+") as open_file:
            names: list[str] = []
            open_file.visit(names.append)
            for _ in range(int(rng.integers(1, 3))):
                name = names[int(rng.integers(len(names)))]
                if name in open_file:
                    _spoil(open_file, name, rng)
        return file.read_bytes()


def _spoil(file: Any, name: str, rng: np.random.Generator) -> None:
    import h5py

    node = file[name]
    way = int(rng.integers(5))
    if way == 0 or not isinstance(node, h5py.Dataset) or not isinstance(node[()], np.ndarray):
        del file[name]
        if rng.random() < 0.5:
            file[name] = np.array([[1.0, 2.0]]) if rng.random() < 0.5 else np.bytes_(b"text")
        return
    value = np.asarray(node[()]).copy()
    del file[name]
    if way == 1:
        value = value.ravel()[: max(0, value.size - 1)]
    elif way == 2:
        value = value.astype(str(rng.choice(["f8", "i8", "i2", "u1", "c16", "f2"])))
    elif value.size:
        flat = value.reshape(-1)
        bad = (
            [-1, 0, 1, 2**31 - 1, -(2**31)] if value.dtype.kind == "i" else [np.nan, np.inf, 0.0, -1.0, 1e300, -1e-300]
        )
        flat[int(rng.integers(value.size))] = bad[int(rng.integers(len(bad)))]
    file[name] = value


@functools.cache
def _good_run(stopped: bool) -> bytes:
    from fenchel.dem.motion import run_motion

    class Stop(Exception):
        pass

    def watch(progress: Any) -> None:
        if stopped:
            raise Stop

    with tempfile.TemporaryDirectory() as folder:
        scene, run = Path(folder) / "scene.toml", Path(folder) / "run.h5"
        scene.write_text(MOTION)
        with contextlib.suppress(Stop):
            run_motion(scene, run, progress=watch, every=0.0)
        return run.read_bytes()


def _run(rng: np.random.Generator, kind: str) -> bytes:
    return damaged(_good_run(kind == "checkpoint"), rng)


_checkpoint = _run


# -- judging --------------------------------------------------------------------------------------------------------------------------


def judge(case: dict[str, Any]) -> str:
    """Read the file as a user would, in a folder of its own, and look at what is left there."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / {"law": "law.py", "path": "path.csv", "fclib": "p.hdf5"}.get(case["kind"], "file.toml")
        if case["kind"] in ("run", "checkpoint"):
            file = folder / "run.h5"
            (folder / "scene.toml").write_text(MOTION)
        file.write_bytes(base64.b64decode(case["bytes"]))
        before = {p.name for p in folder.iterdir()}
        verdict, wanted = READERS[case["kind"]](folder, file)
        left = {p.name for p in folder.iterdir() if p.name != "__pycache__"} - before
        if left - set(wanted):
            raise Failure(f"{case['kind']}: left behind {sorted(left)}, verdict {verdict}")
        return f"{case['kind']}: {verdict}"


def by_command(*arguments: str, output: str = "") -> tuple[str, tuple[str, ...]]:
    """Verdict of the command line; the output may be there only if it succeeded."""
    code, _, said = command(*arguments)
    if code and len(said.splitlines()) > 1:
        raise Failure(f"exit code {code} with {len(said.splitlines())} lines: {said[:300]!r}")
    if code:
        return ("refused" if code == 2 else "failed"), ()
    return "answer", (output,) if output else ()


def read_path_file(folder: Path, file: Path) -> tuple[str, tuple[str, ...]]:
    """By its reader, then along the path with a law of the library."""
    from fenchel.integrators import read_path

    try:
        plan = read_path(file)
    except FenchelError as error:
        foreseen(error)
        return "refused", ()
    # components that a trace condition replaces have no target, and say so by nan
    given = plan.targets if plan.trace is None else plan.targets[:, ~np.isnan(plan.targets).all(axis=0)]
    for part in (plan.time, given, plan.trace_targets, plan.temperature):
        if part is not None and not np.isfinite(part).all():
            raise Failure("a path is read that holds a number which is not finite")
    law = "thermo_elasto_plastic" if plan.temperature is not None else "von_mises"
    values = {"E": 2e11, "nu": 0.3, "sigma_y": 3e8, "H_i": 1e9}
    values |= {"alpha_T": 1e-5, "T_0": 300.0, "C_v": 3e6, "k": 50.0} if law != "von_mises" else {"H_k": 0.0}
    pairs = [x for n, v in values.items() for x in ("-p", f"{n}={v}")]
    return by_command("drive", law, str(file), *pairs, "-o", str(folder / "out.csv"), output="out.csv")


def read_parameters(folder: Path, file: Path) -> tuple[str, tuple[str, ...]]:
    """As a file of parameters of a check."""
    return by_command("check", "von_mises", "--parameters", str(file))


def read_scene_file(folder: Path, file: Path) -> tuple[str, tuple[str, ...]]:
    """By its reader, and by the command if it is small or refused."""
    reason = small(file)
    if reason == "large":
        return "accepted, too large to run", ()
    code, _, _ = command("dem", str(file), "-o", str(folder / "out.h5"), "--quiet")
    if code != 2 and reason:
        raise Failure(f"a scene that its reader refuses runs: {reason}")
    return {0: "answer", 1: "stopped", 2: "refused"}[code], () if code == 2 else ("out.h5",)


def read_study_file(folder: Path, file: Path) -> tuple[str, tuple[str, ...]]:
    """By its reader alone: a study takes hours."""
    from fenchel.identify.study import read_study

    try:
        read_study(file)
    except FenchelError as error:
        foreseen(error)
        return "refused", ()
    return "answer", ()


def read_law(folder: Path, file: Path) -> tuple[str, tuple[str, ...]]:
    """Shown and checked, and a step made if it is admissible."""
    code, _, said = command("check", f"{file}:law")
    if code == 1 and said:
        raise Failure(f"check ends with 1 and says {said[:200]!r}")
    if code == 2:
        return "refused", ()
    shown, _, said = command("show", f"{file}:law", "--formulation", "stress" if code else "strain")
    if shown == 1:
        raise Failure(f"show fails: {said}")
    if code == 1:
        return "not admissible", ()
    from fenchel.potentials import load_law

    law = load_law(f"{file}:law")
    values = {"E": 1e7, "nu": 0.2, "k": 3e3, "H": 1e5, "eta": 1e5, "n": 2.0}
    given = {p.name: values[p.name] for p in law.parameters} | ({"T": 310.0} if law.temperature is not None else {})
    try:
        out = law.compile()([1e-3, 2e-4, -5e-4, 1e-4, 0, 0], None, 0.5, **given)
    except FenchelError as error:
        foreseen(error)
        return "admissible, step refused", ()
    if not (np.isfinite(out.stress).all() and np.isfinite(out.tangent).all()):
        raise Failure("a step of an admissible law is not finite with status converged")
    return "answer", ()


def read_problem(folder: Path, file: Path) -> tuple[str, tuple[str, ...]]:
    """Solved within a second."""
    return (
        by_command("contact", str(file), "--time-limit", "1", "--tolerance", "1e-6", "--json")
        if sound(file)
        else ("unreadable", ())
    )


def sound(file: Path) -> bool:
    """Whether our own reader answers; what it says has to be foreseen."""
    from fenchel.dem.one_step import read_fclib

    try:
        read_fclib(file)
    except FenchelError as error:
        foreseen(error)
        code, _, _ = command("contact", str(file))
        if code != 2:
            raise Failure(f"a problem that cannot be read ends with exit code {code}") from None
        return False
    return True


def read_run(folder: Path, file: Path) -> tuple[str, tuple[str, ...]]:
    """Taken up again: refused, or finished as if nothing had happened, with every number that a sound file has."""
    before = file.read_bytes()
    code, _, said = command("dem", str(folder / "scene.toml"), "-o", str(file), "--resume", "--quiet")
    if code == 0 and before not in (_good_run(True), _good_run(False)):
        raise Failure("a damaged run file is taken for a whole one")
    if code and file.read_bytes() != before:
        raise Failure("a run file that was refused has been changed")
    if code == 1:
        raise Failure(f"a damaged run file fails with {said!r}")
    return {0: "answer", 2: "refused"}[code], ()


READERS: dict[str, Callable[[Path, Path], tuple[str, tuple[str, ...]]]] = {
    "path": read_path_file, "parameters": read_parameters, "scene": read_scene_file, "motion": read_scene_file,
    "slope": read_scene_file, "study": read_study_file, "law": read_law, "fclib": read_problem, "run": read_run, "checkpoint": read_run,
}  # fmt: skip
