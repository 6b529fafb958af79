"""Compiled code follows the sources: an edit of a callee in another file, or in a room below, is seen."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fenchel import cache

CALLER = """
from ..cache import njit
from ..potentials.callee import factor

@njit
def scaled(x):
    return factor() * x
"""
CALLEE = """
from ..cache import njit

@njit
def factor():
    return {value}
"""


@pytest.fixture
def small(tmp_path, monkeypatch):
    """A package of the same name and rooms, with the real cache.py, whose compiled code goes to a folder of its own."""
    monkeypatch.setenv("FENCHEL_CACHE", str(tmp_path / "cache"))
    package = tmp_path / "fenchel"
    for room in ("", "potentials", "integrators", "dem"):
        (package / room).mkdir()
        (package / room / "__init__.py").touch()
    for file in ("cache.py", "errors.py"):
        shutil.copy(Path(cache.__file__).with_name(file), package / file)
    (package / "integrators" / "caller.py").write_text(CALLER)
    return package


def answer(package, value):
    (package / "potentials" / "callee.py").write_text(CALLEE.format(value=value))
    script = "from fenchel.integrators.caller import scaled; print(scaled(2.0))"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=package.parent, capture_output=True, text=True, check=True
    )
    return float(done.stdout)


def test_an_edited_callee_in_a_room_below_is_compiled_again(small):
    assert answer(small, 10.0) == 20.0
    before = {file.parent.parent for file in (small.parent / "cache").rglob("*scaled*.nbc")}
    assert answer(small, 11.0) == 22.0
    assert answer(small, 10.0) == 20.0
    after = {file.parent.parent for file in (small.parent / "cache").rglob("*scaled*.nbc")}
    assert len(before) == 1
    assert len(after) == 2


def test_code_is_kept_while_nothing_that_it_can_call_changes(small):
    answer(small, 10.0)
    (small / "dem" / "other.py").write_text("x = 1\n")
    compiled = sorted((small.parent / "cache").rglob("*.nbc"))
    stamps = [file.stat().st_mtime_ns for file in compiled]
    answer(small, 10.0)
    assert sorted((small.parent / "cache").rglob("*.nbc")) == compiled
    assert [file.stat().st_mtime_ns for file in compiled] == stamps


def test_the_hash_separates_its_texts():
    assert cache.content_hash("ab", "c") != cache.content_hash("a", "bc")
    assert cache.content_hash("ab") == cache.content_hash(b"ab")
    assert len(cache.content_hash()) == 20


def test_the_cache_folder_is_the_users_choice(tmp_path, monkeypatch):
    monkeypatch.setenv("FENCHEL_CACHE", str(tmp_path))
    assert cache.cache_folder() == tmp_path
    monkeypatch.delenv("FENCHEL_CACHE")
    assert cache.cache_folder().name == "fenchel"


VARIANTS = """
from numba import float64, types
from ..cache import njit

signature = float64(float64)

def variant(power, inner=None):
    def raised(x):
        y = x if inner is None else inner(x)
        return y**power
    return njit(raised, signature_or_function=signature)

@njit
def through(pointer, x):
    return pointer(x)
"""


@pytest.mark.parametrize("nested", [False, True])
def test_variants_compiled_by_different_processes_stay_apart_in_one(small, nested):
    """numba names a symbol by the qualified name and a counter of the process: of two variants of a closure, each compiled as the same
    function of its process, whoever read both from disk ran the one for the other."""
    (small / "integrators" / "variants.py").write_text(VARIANTS)
    made = "variant(1, variant({0}))" if nested else "variant({0})"

    def values(*powers):
        made_all = ", ".join(made.format(power) for power in powers)
        code = (
            "from fenchel.integrators.variants import through, variant\n"
            f"made = [{made_all}]\n"
            "print(*(int(through(f, 3.0)) for f in made), *(int(f(3.0)) for f in made))"
        )
        return subprocess.run(
            [sys.executable, "-c", code], cwd=small.parent, capture_output=True, text=True, check=True, timeout=120
        ).stdout.split()

    assert values(2) == 2 * ["9"]
    assert values(4) == 2 * ["81"]
    assert values(2, 4) == 2 * ["9", "81"]
    assert values(4, 2) == 2 * ["81", "9"]
