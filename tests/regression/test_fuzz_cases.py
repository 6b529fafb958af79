"""Failures that the search found (`tests/fuzz`, one line each in `fuzz_cases.txt`), and the first seeds of every target as a sample of
it."""

from pathlib import Path

import pytest
from fuzz.case import TARGETS, run_line

FOUND = [
    line
    for line in (Path(__file__).parent / "fuzz_cases.txt").read_text().splitlines()
    if line.strip() and not line.startswith("#")
]
SAMPLE = {"laws": 12, "scenes": 16, "files": 40, "contacts": 24}


@pytest.mark.parametrize("line", FOUND, ids=lambda line: line[:24])
def test_a_failure_that_was_found_stays_mended(line):
    outcome = run_line(line)
    assert not outcome.failure, f"{outcome.trace}{outcome.failure}"


# random laws compile for ten seconds each: their sample belongs to `make validate`, what was found among them stays here
@pytest.mark.parametrize("target", [pytest.param(t, marks=pytest.mark.validate) if t == "laws" else t for t in TARGETS])
def test_a_sample_of_the_search_finds_nothing(target):
    verdicts = set()
    for seed in range(SAMPLE[target]):
        outcome = run_line(f"{target} {seed}")
        assert not outcome.failure, f"{outcome.line}: {outcome.trace}{outcome.failure}"
        verdicts.add(outcome.verdict)
    assert len(verdicts) > 1


def test_lines_name_targets_that_exist():
    assert {line.split()[0] for line in FOUND} <= set(TARGETS)
