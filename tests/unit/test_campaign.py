"""Campaigns: order, needs, failures, dead workers, finished tasks never run twice; on local cores and on a dask cluster."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from fenchel.campaign import Computation, run_campaign
from fenchel.errors import ConvergenceError, FenchelError, InputError


def _log(folder: str, text: str) -> None:
    with open(Path(folder) / "log", "a") as file:
        file.write(text + "\n")


def lines(folder: Path) -> list[str]:
    return (folder / "log").read_text().splitlines() if (folder / "log").exists() else []


def square(folder: str, number: float, pause: float = 0.0) -> dict:
    _log(folder, f"begin {number:g} {os.getpid()}")
    time.sleep(pause)
    _log(folder, f"end {number:g}")
    return {"square": number**2, "row": np.arange(3) * number, "deep": {"word": "yes"}}


def die_once(folder: str, number: float) -> dict:
    """The worker that takes this for the first time is killed in mid-run."""
    first = not any(line.startswith(f"dying {number:g}") for line in lines(Path(folder)))
    _log(folder, f"dying {number:g}")
    if first:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"square": number**2}


def die(folder: str) -> dict:
    _log(folder, "dying")
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def fail(folder: str) -> dict:
    _log(folder, "failed")
    raise ConvergenceError("it does not converge")


def task(folder: Path, number: float, needs: tuple[str, ...] = (), **more) -> Computation:
    return Computation(f"square {number:g}", square, folder, {"folder": str(folder), "number": number, **more}, needs)


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_by_name_and_needs_first(tmp_path, jobs):
    tasks = [task(tmp_path, 1.0, ("square 2", "square 3")), task(tmp_path, 2.0, ("square 3",)), task(tmp_path, 3.0)]
    found = run_campaign(tasks, tmp_path, jobs=jobs, show=False)
    assert list(found) == ["square 1", "square 2", "square 3"]
    assert found["square 3"]["square"] == 9.0 and found["square 3"]["deep"]["word"] == "yes"
    np.testing.assert_array_equal(found["square 2"]["row"], [0.0, 2.0, 4.0])
    order = [line for line in lines(tmp_path) if line.startswith("end")]
    assert order == ["end 3", "end 2", "end 1"]


def test_finished_tasks_never_run_twice(tmp_path):
    tasks = [task(tmp_path, k) for k in (1.0, 2.0)]
    first = run_campaign(tasks, tmp_path, jobs=1, show=False)
    again = run_campaign([*tasks, task(tmp_path, 3.0)], tmp_path, jobs=2, show=False)
    assert sorted(line for line in lines(tmp_path) if line.startswith("end")) == ["end 1", "end 2", "end 3"]
    assert again["square 1"]["square"] == first["square 1"]["square"]
    with pytest.raises(InputError, match="other settings"):
        Computation("square 1", square, tmp_path, {"folder": str(tmp_path), "number": 5.0})()


def test_a_dead_worker_is_replaced_and_its_task_tried_again(tmp_path):
    tasks = [
        Computation("risky", die_once, tmp_path, {"folder": str(tmp_path), "number": 4.0}),
        task(tmp_path, 2.0, pause=0.5),
    ]
    found = run_campaign(tasks, tmp_path, jobs=2, show=False)
    assert found["risky"]["square"] == 16.0 and found["square 2"]["square"] == 4.0
    assert lines(tmp_path).count("dying 4") == 2
    assert lines(tmp_path).count("end 2") >= 1


def test_a_task_that_kills_every_worker_is_given_up(tmp_path):
    doomed = Computation("doomed", die, tmp_path, {"folder": str(tmp_path)})
    with pytest.raises(FenchelError, match="doomed: its worker died 3 times"):
        run_campaign([doomed], tmp_path, jobs=2, show=False)
    assert lines(tmp_path).count("dying") == 3


def test_a_failure_stops_the_campaign_or_is_a_result(tmp_path):
    tasks = [
        Computation("bad", fail, tmp_path, {"folder": str(tmp_path)}),
        task(tmp_path, 2.0, ("bad",)),
        task(tmp_path, 3.0, ("square 2",)),
        task(tmp_path, 5.0),
    ]
    with pytest.raises(ConvergenceError, match="does not converge"):
        run_campaign(tasks, tmp_path, jobs=1, show=False)
    found = run_campaign(tasks, tmp_path, jobs=1, show=False, keep_going=True)
    assert all(isinstance(found[name], ConvergenceError) for name in ("bad", "square 2", "square 3"))
    assert found["square 5"]["square"] == 25.0
    assert not any(line.startswith("begin 2") for line in lines(tmp_path))


def program(folder: str) -> dict:
    return {"program": "mine"}


def test_a_result_may_not_take_the_name_of_what_the_file_says_of_itself(tmp_path):
    with pytest.raises(ValueError, match="'program' is one of the file itself"):
        Computation("named", program, tmp_path, {"folder": ""})()


def test_what_is_no_campaign(tmp_path):
    with pytest.raises(InputError, match="two tasks are called 'square 1'"):
        run_campaign([task(tmp_path, 1.0), task(tmp_path, 1.0)], tmp_path, show=False)
    with pytest.raises(InputError, match="no task is called 'square 9'"):
        run_campaign([task(tmp_path, 1.0, ("square 9",))], tmp_path, show=False)
    with pytest.raises(InputError, match="waits for itself"):
        run_campaign(
            [task(tmp_path, 1.0, ("square 2",)), task(tmp_path, 2.0, ("square 1",))], tmp_path, jobs=1, show=False
        )
    with pytest.raises(InputError, match="jobs = 0"):
        run_campaign([task(tmp_path, 1.0)], tmp_path, jobs=0, show=False)


# -- on a cluster: a scheduler and workers as processes of their own on the loopback interface ------------------------------------


@dataclass
class Cluster:
    address: str
    workers: list[subprocess.Popen]


@pytest.fixture
def cluster(tmp_path):
    pytest.importorskip("distributed", reason="dask.distributed is an extra: fenchel[cluster]")
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    address_file = tmp_path / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    options = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(address_file)]
    scheduler = subprocess.Popen([*command, *options], **quiet)
    here = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])}
    worker = [
        sys.executable,
        "-m",
        "distributed.cli.dask_worker",
        "--scheduler-file",
        str(address_file),
        "--nthreads",
        "1",
        "--no-nanny",
    ]
    workers = [
        subprocess.Popen([*worker, "--no-dashboard", "--local-directory", str(tmp_path / f"w{k}")], env=here, **quiet)
        for k in range(3)
    ]
    deadline = time.monotonic() + 60.0
    while not address_file.exists() and time.monotonic() < deadline:
        time.sleep(0.1)
    import json

    address = json.loads(address_file.read_text())["address"]
    from distributed import Client

    with Client(address, timeout=30, set_as_default=False) as client:
        client.wait_for_workers(3, timeout=60)
    yield Cluster(address, workers)
    for process in (*workers, scheduler):
        process.kill()
    for process in (*workers, scheduler):
        process.wait()


def test_a_cluster_gives_the_same_results_also_when_a_worker_is_killed_in_mid_run(tmp_path, cluster):
    here, there = tmp_path / "here", tmp_path / "there"
    numbers = [float(k) for k in range(1, 9)]
    for folder in (here, there):
        folder.mkdir()
    expected = run_campaign([task(here, k) for k in numbers], here, jobs=1, show=False)

    killed = []

    def kill_one() -> None:
        """Kill a worker that is in the middle of a task."""
        while not killed:
            told = [line.split() for line in lines(there)]
            over = {number for word, number, *_ in told if word == "end"}
            busy = [int(pid) for word, number, *pid in told if word == "begin" and number not in over for pid in pid]
            for worker in cluster.workers:
                if len(over) >= 2 and worker.pid in busy:
                    worker.kill()
                    killed.append(worker)
                    return
            time.sleep(0.02)

    killer = threading.Thread(target=kill_one)
    killer.start()
    tasks = [task(there, k, pause=0.6) for k in numbers]
    found = run_campaign(tasks, there, scheduler=cluster.address, show=False)
    killer.join()
    assert killed[0].wait() != 0
    assert {n: r["square"] for n, r in found.items()} == {n: r["square"] for n, r in expected.items()}
    ended = [line for line in lines(there) if line.startswith("end")]
    assert sorted(set(ended)) == sorted(f"end {k:g}" for k in numbers)
    # the one that was at work is begun again, what was finished is not
    begun = [line.split()[1] for line in lines(there) if line.startswith("begin")]
    assert len(begun) == len(numbers) + 1 and len(ended) == len(numbers)
    before = len(lines(there))
    again = run_campaign(tasks, there, scheduler=cluster.address, show=False)
    assert len(lines(there)) == before and {n: r["square"] for n, r in again.items()} == {
        n: r["square"] for n, r in found.items()
    }


def test_a_scheduler_that_does_not_answer_is_one_line(tmp_path):
    pytest.importorskip("distributed")
    with pytest.raises(InputError, match="no dask scheduler answers there"):
        run_campaign([task(tmp_path, 1.0)], tmp_path, scheduler="tcp://127.0.0.1:9", show=False)
