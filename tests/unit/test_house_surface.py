"""The public surface: every name has one import path, and importing is cheap."""

import importlib
import importlib.util
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HEAVY = (
    "matplotlib",
    "cvxpy",
    "skfem",
    "h5py",
    "sympy",
    "numba",
    "scipy",
    "numpy",
    "typer",
    "distributed",
    "pyvista",
    "joblib",
)


def surface():
    """docs/_generate/public_surface.py, which the page is made by."""
    spec = importlib.util.spec_from_file_location("public_surface", ROOT / "docs/_generate/public_surface.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


PAGE = surface()
ROOMS = PAGE.rooms(ROOT / "docs/reference/api.rst")


def test_the_page_has_every_room_once():
    assert len(set(ROOMS)) == len(ROOMS)
    wanted = {"potentials", "potentials.library", "integrators", "dem", "identify", "campaign"}
    assert {f"fenchel.{room}" for room in wanted} <= set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_every_public_name_is_there_and_said_once(room):
    module = importlib.import_module(room)
    assert len(set(module.__all__)) == len(module.__all__) > 0
    missing = [name for name in module.__all__ if not hasattr(module, name)]
    assert missing == []


def test_every_public_name_has_one_path():
    """Each symbol of each `__all__` is listed on the page once: in its own room, or in the one that it was imported from."""
    entries = Counter(
        id(getattr(importlib.import_module(room), name)) for room in ROOMS for name, _ in PAGE.listed(room)
    )
    assert sum(entries.values()) > 250
    public = {
        f"{room}.{name}": entries[id(getattr(importlib.import_module(room), name))]
        for room in ROOMS
        for name in importlib.import_module(room).__all__
    }
    assert {path: count for path, count in public.items() if count != 1} == {}


def loaded_after(statement):
    code = f"import sys\n{statement}\nprint('\\n'.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return {name.partition(".")[0] for name in done.stdout.split()}


def test_importing_the_face_imports_nothing_heavy():
    assert loaded_after("import fenchel") & set(HEAVY) == set()


@pytest.mark.parametrize("room", ["dem", "potentials", "integrators", "campaign", "identify"])
def test_importing_a_room_draws_and_solves_nothing(room):
    wanted_not = {"matplotlib", "cvxpy", "skfem", "h5py", "clarabel", "distributed", "pyvista", "joblib"}
    assert loaded_after(f"import fenchel.{room}") & wanted_not == set()


def test_the_command_line_starts_without_the_rooms():
    """`fenchel --version` and `--help` answer at once."""
    loaded = loaded_after("import fenchel.cli")
    assert loaded & {"matplotlib", "cvxpy", "skfem", "h5py", "sympy", "numba", "scipy"} == set()


def test_the_version_is_that_of_the_project():
    import tomllib

    import fenchel

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert fenchel.__version__ == project["version"] and re.fullmatch(r"\d+\.\d+\.\d+", fenchel.__version__)
