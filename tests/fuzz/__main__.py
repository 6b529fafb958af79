"""Search until the time is over: `python -m fuzz [--seconds S] [--seed N] [--case LINE] [TARGET ...]`; exit code 1 if a case failed."""

from __future__ import annotations

import argparse
import collections
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
if __package__ in (None, ""):  # run as `python tests/fuzz`
    sys.path.insert(0, str(TESTS))
    __package__ = "fuzz"

from .case import LIMIT, TARGETS, line_of, run_line  # noqa: E402

BATCH = 150  # cases of one child, which then makes room in memory
WALL = 3.0  # a child that uses no processor may wait this many limits


def main() -> int:
    """Parse, search, say what was found."""
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"of {', '.join(TARGETS)}; default: all in turn")
    parser.add_argument("--seconds", type=float, default=60.0, help="how long, shared by the targets")
    parser.add_argument("--seed", type=int, default=None, help="the first case; default: random, and printed")
    parser.add_argument("--case", default=None, metavar="LINE", help="run one case, for example 'laws 48213'")
    parser.add_argument("--child", nargs=4, default=None, help=argparse.SUPPRESS)
    given = parser.parse_args()
    # generated code of thousands of laws has no place in the user's own cache
    os.environ.setdefault("FENCHEL_CACHE", str(TESTS.parent / "build" / "fuzz"))
    if given.child is not None:
        return child(*given.child)
    if given.case is not None:
        outcome = run_line(given.case)
        print(outcome.trace + f"{given.case[:80]}: {outcome.failure or outcome.verdict}")
        return int(bool(outcome.failure))
    seed = int.from_bytes(os.urandom(4), "little") if given.seed is None else given.seed
    targets = given.targets or list(TARGETS)
    for target in targets:
        if target not in TARGETS:
            parser.error(f"target {target!r} is not known: one of {', '.join(TARGETS)}")
    failures = 0
    for target in targets:
        failures += search(target, seed, given.seconds / len(targets))
    return int(failures > 0)


def search(target: str, seed: int, seconds: float) -> int:
    """Cases of one target from `seed` on; prints what failed as lines for the file of cases, and the counts."""
    print(f"fuzz: {target} from seed {seed} for {seconds:.0f} s", flush=True)
    end, counts, failures, slowest = time.monotonic() + seconds, collections.Counter(), [], (0.0, "")
    while time.monotonic() < end:
        done, lost = batch(target, seed, end)
        for report in done:
            counts[report["verdict"]] += 1
            slowest = max(slowest, (report["seconds"], report["line"]))
            if report["failure"]:
                failures.append(report["line"])
                told(target, report["line"], report["failure"], report["trace"])
        seed += len(done)
        if lost is not None:
            counts["failure"] += 1
            failures.append(lost[0])
            told(target, lost[0], lost[1], "")
            seed += 1
    total = sum(counts.values())
    shares = ", ".join(f"{count} {verdict}" for verdict, count in counts.most_common())
    print(f"fuzz: {target}: {total} cases, {len(failures)} failures: {shares}; slowest {slowest[1]} {slowest[0]:.1f} s")
    return len(failures)


def told(target: str, line: str, failure: str, trace: str) -> None:
    """A failure, with the line to add."""
    seed = int(line.split()[1])
    try:
        kept = line_of(target, seed)
    except Exception as error:
        kept = f"{line}    (cannot be drawn: {type(error).__name__})"
    print(f"{trace}FAILURE {line}: {failure}\n  add to tests/regression/fuzz_cases.txt:\n{kept}", flush=True)


def batch(target: str, seed: int, end: float) -> tuple[list[dict], tuple[str, str] | None]:
    """(reports, the case that was lost and how) of one child."""
    with tempfile.TemporaryDirectory() as folder:
        journal, current = Path(folder) / "journal", Path(folder) / "current"
        journal.touch()
        process = subprocess.Popen(
            [sys.executable, "-m", "fuzz", "--child", target, str(seed), str(max(0.0, end - time.monotonic())), folder],
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), *os.environ.get("PYTHONPATH", "").split(os.pathsep)])},
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=folder,
        )  # fmt: skip
        hung, began = False, time.monotonic()
        while process.poll() is None:
            time.sleep(0.2)
            touched = current.stat().st_mtime if current.exists() else time.time()
            if time.time() - touched > WALL * LIMIT or time.monotonic() - began > 3600 + WALL * LIMIT:
                process.kill()
                process.wait()
                hung = True
        said = process.stderr.read().decode(errors="replace") if process.stderr else ""
        reports = [json.loads(line) for line in journal.read_text().splitlines()]
        if process.returncode == 0 and not hung:
            return reports, None
        line = current.read_text() if current.exists() else f"{target} {seed}"
        how = f"hangs: {WALL * LIMIT:g} s without an end" if hung else f"the process ended with {process.returncode}"
        return reports, (line, f"{how}: {' '.join(said.split())[-300:]}")


def child(target: str, seed: str, seconds: str, folder: str) -> int:
    """Run cases one after the other; what runs stands in `current` before it starts."""
    import faulthandler
    import resource

    faulthandler.enable()
    resource.setrlimit(resource.RLIMIT_AS, (8 << 30, resource.RLIM_INFINITY))
    end = time.monotonic() + float(seconds)
    with (Path(folder) / "journal").open("a") as journal:
        for number in range(int(seed), int(seed) + BATCH):
            if time.monotonic() >= end:
                break
            line = f"{target} {number}"
            (Path(folder) / "current").write_text(line)
            began = time.perf_counter()
            outcome = run_line(line)
            seconds_taken = time.perf_counter() - began
            report = {"line": line, "verdict": outcome.verdict, "failure": outcome.failure, "trace": outcome.trace}
            print(json.dumps(report | {"seconds": seconds_taken}), file=journal, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
