"""What a user installs: the source distribution, the wheel built from it, and that wheel in a clean environment without the checkout.

Everything is offline: the build backend is that of the lock, and the dependencies are those of the environment that runs the tests.
"""

import shutil
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = {
    "fenchel": "src/fenchel",
    "fenchel/potentials": "potentials",
    "fenchel/integrators": "integrators",
    "fenchel/dem": "dem",
}
BUILD = "import sys; from setuptools import build_meta; print(getattr(build_meta, 'build_' + sys.argv[1])(sys.argv[2]))"


def run(*command, cwd):
    done = subprocess.run([str(part) for part in command], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def built(kind, tree, target):
    return target / run(sys.executable, "-c", BUILD, kind, target, cwd=tree).split()[-1]


def sources():
    """What the rooms hold, by its place in the package."""
    return {
        f"{package}/{file.relative_to(ROOT / folder).as_posix()}"
        for package, folder in ROOMS.items()
        for file in (ROOT / folder).rglob("*")
        if file.is_file() and "__pycache__" not in file.parts and not file.name.startswith(".")
    }


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel that is built from the source distribution alone."""
    place = tmp_path_factory.mktemp("dist")
    tree = place / "tree"
    tree.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tree)
    for folder in ROOMS.values():
        shutil.copytree(ROOT / folder, tree / folder, ignore=shutil.ignore_patterns("__pycache__", ".*"))
    archive = built("sdist", tree, place)
    with tarfile.open(archive) as packed:
        packed.extractall(place / "unpacked", filter="data")
    (unpacked,) = (place / "unpacked").iterdir()
    assert (unpacked / "LICENSE").exists() and (unpacked / "README.md").exists()
    return built("wheel", unpacked, place)


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """The interpreter of a clean environment with the wheel in it; what it depends on is seen through a path file."""
    place = tmp_path_factory.mktemp("clean") / "venv"
    venv.create(place, with_pip=False)
    folder = "Scripts" if sys.platform == "win32" else "bin"
    found = place / folder / Path(sys.executable).name
    inside = Path(run(found, "-I", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=place).strip())
    # a path in such a file is searched, but its own path files, and so the editable install, are not read
    (inside / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    pip = (sys.executable, "-m", "pip", "--python", found, "--disable-pip-version-check", "--no-input")
    run(*pip, "install", "--quiet", "--no-index", "--no-deps", "--no-compile", "--ignore-installed", wheel, cwd=place)
    return found


def test_the_wheel_holds_every_file_of_the_rooms_and_no_other(wheel):
    with zipfile.ZipFile(wheel) as packed:
        names = {name for name in packed.namelist() if ".dist-info/" not in name}
        about = {name.rpartition("/")[2] for name in packed.namelist() if ".dist-info/" in name}
    assert names == sources()
    assert {"fenchel/py.typed", "fenchel/identify/demo.toml"} <= names
    assert sum(name.startswith("fenchel/fronts/") for name in names) >= 3
    assert {"LICENSE", "METADATA", "entry_points.txt"} <= about


def test_it_is_the_wheel_that_answers(python, tmp_path):
    import fenchel

    said = run(python, "-I", "-c", "import fenchel; print(fenchel.__file__)", cwd=tmp_path).strip()
    assert Path(said).is_relative_to(python.parents[1]) and Path(said) != Path(fenchel.__file__)
    command = python.with_name("fenchel.exe" if sys.platform == "win32" else "fenchel")
    assert run(command, "--version", cwd=tmp_path) == f"fenchel {fenchel.__version__}\n"
    assert "identify" in run(command, "--help", cwd=tmp_path)


def test_every_module_can_be_imported_and_every_file_beside_them_be_read(python, tmp_path):
    code = """
import importlib, json, pkgutil
from importlib import resources
import fenchel
names = [m.name for m in pkgutil.walk_packages(fenchel.__path__, "fenchel.") if not m.name.endswith("__main__")]
for name in names:
    importlib.import_module(name)
fronts = [f for f in resources.files("fenchel").joinpath("fronts").iterdir() if f.name.endswith(".json")]
for front in fronts:
    json.loads(front.read_text(encoding="utf-8"))
from fenchel.identify.study import demo_study
study, _ = demo_study()
print(len(names), len(fronts), type(study).__name__)
"""
    names, fronts, study = run(python, "-I", "-c", code, cwd=tmp_path).split()
    modules = [name for name in sources() if name.endswith(".py")]
    assert int(names) == len(modules) - 1 - sum(name.endswith("__main__.py") for name in modules)
    assert int(fronts) == len(list((ROOT / "src/fenchel/fronts").glob("*.json"))) and study == "Study"
