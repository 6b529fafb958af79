"""Points shared between threads. Points know nothing of each other, so that the answer does not depend on the number of threads."""

from __future__ import annotations

import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from ..errors import InputError

__all__ = ["checked_threads", "shared"]

LEAST = 256  # points below which a second thread costs more than it saves


def checked_threads(threads: int) -> int:
    """A number of threads; `InputError` for anything else."""
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        raise InputError(f"threads = {threads!r}: the number of threads must be a whole number of at least 1")
    return threads


def shared(run: Callable[[int, int], None], count: int, threads: int, chunk: int | None = None) -> None:
    """`run(start, stop)` over 0 … count in at most `threads` runs at once; the first error is raised.

    Without `chunk` every thread takes one run of rows; with it runs of so many in turn, which evens out points of unequal cost.
    """
    parts = min(threads, max(count // LEAST, 1))
    if parts == 1:
        run(0, count)
        return
    size = chunk or -(-count // parts)
    runs = [(start, min(start + size, count)) for start in range(0, count, size)]

    def take(part: int) -> None:
        for edges in runs[part::parts]:
            run(*edges)

    waiting = [_pool(threads).submit(take, part) for part in range(1, parts)]
    take(0)
    for task in waiting:
        task.result()


@functools.cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Threads that wait for work, one less than are asked for: the caller is the other one."""
    return ThreadPoolExecutor(max_workers=threads - 1, thread_name_prefix="fenchel")
