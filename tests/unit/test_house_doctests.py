"""Every example in a docstring runs."""

import doctest
import importlib
from pathlib import Path

import pytest

import fenchel

ROOT = Path(fenchel.__file__).parent


def module_names():
    for file in sorted(ROOT.rglob("*.py")):
        parts = ("fenchel", *file.relative_to(ROOT).with_suffix("").parts)
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = list(module_names())


def test_the_walk_sees_every_room():
    assert {
        "fenchel",
        "fenchel.cli.values",
        "fenchel.dem.record",
        "fenchel.identify",
        "fenchel.potentials.library",
    } <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_examples(name):
    outcome = doctest.testmod(
        importlib.import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    )
    assert outcome.failed == 0
