"""The locks: every requirement pinned and hashed, no address, and one version of a package in all of them."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LOCKS = sorted((ROOT / "locks").glob("*.txt"))
PIN = re.compile(
    r"(?P<name>[a-z0-9-]+)==(?P<version>[\w.!+]+)(?: ; (?P<marker>[^\\]+?))?(?: --hash=sha256:[0-9a-f]{64})+"
)


def requirements(lock):
    return lock.read_text().replace("\\\n", "").splitlines()


def pins(lock):
    for line in requirements(lock):
        found = PIN.fullmatch(" ".join(line.split()))
        assert found, f"{lock.name}: {line[:60]} is not a pin with hashes"
        yield found["name"], found["version"], found["marker"]


def test_there_are_four_locks():
    assert [lock.name for lock in LOCKS] == ["docs.txt", "lint.txt", "run.txt", "test.txt"]


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.stem)
def test_every_requirement_is_pinned_and_hashed(lock):
    assert len(list(pins(lock))) >= 5


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.stem)
def test_no_address_and_no_option_in_a_lock(lock):
    text = lock.read_text()
    assert "://" not in text
    assert not re.search(r"^\s*-(?!-hash=)", text, flags=re.MULTILINE)
    assert "#" not in text


@pytest.mark.parametrize("lock", [lock for lock in LOCKS if lock.stem != "run"], ids=lambda lock: lock.stem)
def test_a_lock_agrees_with_what_runs(lock):
    running = {}
    for name, version, _ in pins(ROOT / "locks" / "run.txt"):
        running.setdefault(name, set()).add(version)
    clash = {name: version for name, version, _ in pins(lock) if name in running and version not in running[name]}
    assert clash == {}


def test_what_runs_holds_every_dependency_and_the_build_backend():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    wanted = project["project"]["dependencies"] + project["build-system"]["requires"]
    names = {re.match(r"[A-Za-z0-9-]+", item)[0].lower() for item in wanted}
    assert names <= {name for name, _, _ in pins(ROOT / "locks" / "run.txt")}
