"""Where the tasks of a campaign run: in this process, on the local cores (joblib's workers), or on a dask cluster.

An engine takes calls and gives futures. A worker that dies takes its calls with it: they are given back as `WorkerLost`, and the campaign
asks again. On a cluster every worker must see the folder of the campaign under the same path.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import Any, Protocol

from .. import __version__
from ..errors import InputError

__all__ = ["Engine", "LocalEngine", "WorkerLost", "engine_of"]


class WorkerLost(Exception):
    """The process that did the work is gone."""


class Engine(Protocol):
    """Takes calls, tells which are over."""

    @property
    def width(self) -> int:
        """How many calls can go on at the same time."""
        ...

    def submit(self, call: Callable[..., Any], *arguments: Any) -> Any:
        """Begin a call; returns its future."""
        ...

    def wait(self, futures: Iterable[Any]) -> list[Any]:
        """Those of the futures that are over; waits for one."""
        ...

    def result(self, future: Any) -> Any:
        """What the call returned or raised; `WorkerLost` if its worker died."""
        ...

    def close(self, *, kill: bool = False) -> None:
        """Let the workers go; `kill`: without waiting for what they do."""
        ...

    @property
    def caller(self) -> int | None:
        """The process without which the workers have nobody to work for; None: they live on their own."""
        ...


class _InProcess:
    """One call at a time, here."""

    width = 1
    caller = None

    def submit(self, call: Callable[..., Any], *arguments: Any) -> Any:
        future: Future[Any] = Future()
        try:
            future.set_result(call(*arguments))
        except Exception as problem:
            future.set_exception(problem)
        return future

    def wait(self, futures: Iterable[Any]) -> list[Any]:
        return list(futures)

    def result(self, future: Any) -> Any:
        return future.result()

    def close(self, *, kill: bool = False) -> None:
        pass


class LocalEngine:
    """`jobs` worker processes of joblib on this machine."""

    def __init__(self, jobs: int) -> None:
        self.width = jobs
        self.caller: int | None = os.getpid()
        self._made: Any = None

    @property
    def _pool(self) -> Any:
        if self._made is None:
            from joblib.externals.loky import get_reusable_executor

            # numba and BLAS stay on one core each: the tasks are what is parallel
            threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
            self._made = get_reusable_executor(max_workers=self.width, timeout=300, env=threads)
        return self._made

    def submit(self, call: Callable[..., Any], *arguments: Any) -> Any:
        return self._pool.submit(call, *arguments)

    def wait(self, futures: Iterable[Any]) -> list[Any]:
        return list(wait(list(futures), return_when=FIRST_COMPLETED).done)

    def result(self, future: Any) -> Any:
        from concurrent.futures import CancelledError
        from concurrent.futures.process import BrokenProcessPool

        try:
            return future.result()
        except (BrokenProcessPool, CancelledError) as problem:
            self._made = None  # one dead worker breaks the pool: make another
            raise WorkerLost(str(problem)) from None

    def close(self, *, kill: bool = False) -> None:
        if self._made is not None and kill:
            self._made.shutdown(wait=True, kill_workers=True)
            self._made = None


class _ClusterEngine:
    """The workers of a dask scheduler."""

    caller = None

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise InputError(
                "--scheduler needs dask.distributed: python -m pip install 'fenchel[cluster]', here and where the workers run"
            ) from None
        try:
            self._client: Any = Client(address, timeout=10, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as problem:
            raise InputError(
                f"--scheduler {address}: no dask scheduler answers there ({problem}); give the address that `dask scheduler` prints"
            ) from None
        found = set(self._client.run(_version).values())
        if found - {__version__}:
            self.close()
            raise InputError(
                f"--scheduler {address}: its workers run fenchel {', '.join(sorted(found))}, here is {__version__}: install one version"
            )

    @property
    def width(self) -> int:
        return max(1, sum(self._client.nthreads().values()))

    def submit(self, call: Callable[..., Any], *arguments: Any) -> Any:
        # scipy and numba of one worker share a process: whatever the function, it must not be taken for one that was asked before
        return self._client.submit(call, *arguments, pure=False, retries=0)

    def wait(self, futures: Iterable[Any]) -> list[Any]:
        from distributed import wait

        with self._client.as_current():
            over: Any = wait(list(futures), return_when="FIRST_COMPLETED")
        return list(over.done)

    def result(self, future: Any) -> Any:
        from concurrent.futures import CancelledError

        from distributed.scheduler import KilledWorker

        try:
            return future.result()
        except (KilledWorker, CancelledError) as problem:
            raise WorkerLost(str(problem)) from None

    def close(self, *, kill: bool = False) -> None:
        self._client.close()


def _version() -> str:
    return __version__


def engine_of(jobs: int | None = None, scheduler: str | None = None) -> Engine:
    """The engine asked for: the cluster behind `scheduler`, or `jobs` local processes (None: all cores; 1: this process)."""
    if scheduler is not None:
        return _ClusterEngine(scheduler)
    jobs = os.cpu_count() or 1 if jobs is None else jobs
    if jobs < 1:
        raise InputError(f"jobs = {jobs}: needs at least one")
    return _InProcess() if jobs == 1 else LocalEngine(jobs)
