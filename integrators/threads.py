"""Points shared between threads: every thread takes one run of rows, so that the answer does not depend on their number."""

from __future__ import annotations

import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

from ..errors import InputError

__all__ = ["checked_threads", "shared"]

LEAST = 256  # points below which a second thread costs more than it saves


def checked_threads(threads: int) -> int:
    """A number of threads; `InputError` for anything else."""
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        raise InputError(f"threads = {threads!r}: the number of threads must be a whole number of at least 1")
    return threads


def shared(run: Callable[[int, int], None], count: int, threads: int) -> None:
    """`run(start, stop)` over 0 … count in at most `threads` runs at once; the first error is raised."""
    parts = min(threads, max(count // LEAST, 1))
    if parts == 1:
        run(0, count)
        return
    edges = [count * k // parts for k in range(parts + 1)]
    waiting = [_pool(threads).submit(run, *edge) for edge in pairwise(edges[1:])]
    run(0, edges[1])
    for task in waiting:
        task.result()


@functools.cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Threads that wait for work, one less than are asked for: the caller is the other one."""
    return ThreadPoolExecutor(max_workers=threads - 1, thread_name_prefix="fenchel")
