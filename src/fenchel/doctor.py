"""What is installed, where things are kept, what is missing, and whether the two machines inside (compiler, solver) run."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from . import __version__
from .cache import cache_folder

__all__ = ["Finding", "examine"]

_NEEDED = (
    "numpy",
    "scipy",
    "sympy",
    "numba",
    "cvxpy",
    "clarabel",
    "msgspec",
    "typer",
    "rich",
    "joblib",
    "h5py",
    "matplotlib",
    "platformdirs",
)
_OPTIONAL = {"pyvista": "3D views", "scikit-fem": "the finite-element driver", "dask": "runs on several machines"}
_LEAST_DISK = 2.0  # GiB; a demo with its run files and compiled code stays below


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing looked at: what it is, what was found, whether it is needed and fine, and what to do if it is not."""

    name: str
    value: str
    needed: bool = True
    fine: bool = True
    remedy: str = ""


def examine() -> list[Finding]:
    """Look at everything once; nothing raises, what fails is a `Finding` that is not fine."""
    return list(_findings())


def _findings() -> Iterator[Finding]:
    yield Finding(name="fenchel", value=__version__)
    yield Finding(
        name="python",
        value=f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        fine=(3, 11) <= sys.version_info < (3, 15),
        remedy="" if (3, 11) <= sys.version_info < (3, 15) else "use Python 3.11 to 3.14",
    )
    for name in _NEEDED:
        yield _package(name, needed=True, remedy="run make setup")
    for name, use in _OPTIONAL.items():
        yield _package(name, needed=False, remedy=f"only for {use}: pip install {name}")
    yield _attempt("compiler (numba)", _compile)
    yield _attempt("cone solver (clarabel)", _solve)
    yield _attempt("cache folder", _cache)
    yield _attempt("free disk here", _disk)
    yield Finding(
        name="threads",
        value=f"{_processors()} processors, NUMBA_NUM_THREADS={os.environ.get('NUMBA_NUM_THREADS', 'not set')}",
    )


def _package(name: str, *, needed: bool, remedy: str) -> Finding:
    try:
        return Finding(name=name, value=importlib.metadata.version(name), needed=needed)
    except importlib.metadata.PackageNotFoundError:
        return Finding(name=name, value="not installed", needed=needed, fine=False, remedy=remedy)


def _attempt(name: str, trial: Callable[[], str]) -> Finding:
    try:
        return Finding(name=name, value=trial())
    except Exception as problem:  # whatever it is, the doctor reports it and goes on
        text = " ".join(str(problem).split())[:200]
        return Finding(name=name, value="does not work", fine=False, remedy=f"{type(problem).__name__}: {text}")


def _compile() -> str:
    import numba

    @numba.njit
    def twice(x: float) -> float:
        return 2.0 * x

    if twice(21.0) != 42.0:
        raise ArithmeticError("a compiled function gave a wrong number")
    return "compiles"


def _solve() -> str:
    """min ‖x − (2, 0)‖ under x₁ ≤ 1: the solution is (1, 0)."""
    import cvxpy

    x = cvxpy.Variable(2)
    problem = cvxpy.Problem(cvxpy.Minimize(cvxpy.norm(x - [2.0, 0.0])), [x[0] <= 1.0])
    problem.solve(solver="CLARABEL")
    if x.value is None or problem.status != "optimal" or abs(x.value[0] - 1.0) > 1e-6:
        raise ArithmeticError("a cone program gave a wrong answer")
    return "solves"


def _cache() -> str:
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder) as trial:
        trial.write(b"fenchel")
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    return f"{folder}, {size / 2**20:.1f} MiB"


def _disk() -> str:
    free = shutil.disk_usage(Path.cwd()).free / 2**30
    if free < _LEAST_DISK:
        raise OSError(f"only {free:.1f} GiB left, {_LEAST_DISK:.0f} are wanted")
    return f"{free:.1f} GiB"


def _processors() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not every system has it
        return os.cpu_count() or 1
