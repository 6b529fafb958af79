"""The rooms: what pyproject lists is what lies in the folders, and no room can be imported under a second name."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = {
    "fenchel": "src/fenchel",
    "fenchel.potentials": "potentials",
    "fenchel.integrators": "integrators",
    "fenchel.dem": "dem",
}
SETUPTOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]


def packages_on_disk():
    for name, folder in ROOMS.items():
        for init in (ROOT / folder).rglob("__init__.py"):
            inner = init.parent.relative_to(ROOT / folder).parts
            yield ".".join((name, *inner))


def test_pyproject_lists_every_package_and_no_other():
    assert SETUPTOOLS["package-dir"] == ROOMS
    assert sorted(SETUPTOOLS["packages"]) == sorted(packages_on_disk())


def test_every_folder_with_python_files_is_a_package():
    stray = [
        str(file)
        for folder in ROOMS.values()
        for file in (ROOT / folder).rglob("*.py")
        if not (file.parent / "__init__.py").exists()
    ]
    assert stray == []


@pytest.mark.parametrize("room", ["potentials", "integrators", "dem"])
def test_a_bare_import_from_the_checkout_fails(room):
    done = subprocess.run([sys.executable, "-c", f"import {room}"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode != 0
    assert "attempted relative import" in done.stderr


def test_no_file_has_a_name_that_says_nothing():
    vague = re.compile(r"(.*_)?(utils?|helpers?|commons?|core|misc)\.py")
    assert [
        file.name for folder in ROOMS.values() for file in (ROOT / folder).rglob("*.py") if vague.fullmatch(file.name)
    ] == []


def test_the_installed_modules_are_the_files_on_disk():
    """An editable install made before a file was added does not know it: `make setup` would install again."""
    import fenchel

    installed = Path(fenchel.__file__).parent
    missing = [
        f"{folder}/{file.relative_to(ROOT / folder)}"
        for name, folder in ROOMS.items()
        for file in (ROOT / folder).rglob("*.py")
        if not installed.joinpath(*name.split(".")[1:], file.relative_to(ROOT / folder)).exists()
    ]
    assert missing == []
