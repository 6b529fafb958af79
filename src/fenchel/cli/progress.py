"""Progress on standard error: the bar of one run (stage, step, strain, residual, kinetic energy, time left), and notices of what comes."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fenchel.dem import Progress

__all__ = ["notice", "progress_bar", "waiting"]

_PATIENCE = {True: 1.5, False: 20.0}  # s before a wait is explained, on a terminal and elsewhere
_QUIET = 2.0  # s before a notice tells anything
_PACE_OF_NOTICES = 5.0  # s between two notices where there is no terminal
_PACE_OF_LINES = 15.0  # s between two lines where there is no terminal


@contextmanager
def progress_bar(wanted: bool = True) -> Iterator[Callable[[Progress], None] | None]:
    """A function that shows a `Progress`: a bar on a terminal, a line now and then elsewhere; None if not wanted."""
    if not wanted:
        yield None
    elif sys.stderr.isatty():
        with _bar() as show:
            yield show
    else:
        yield _lines()


@contextmanager
def _bar() -> Iterator[Callable[[Progress], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda progress: bar.update(task, completed=progress.fraction, description=_told(progress))


def _lines() -> Callable[[Progress], None]:
    start = shown = time.monotonic()

    def show(progress: Progress) -> None:
        nonlocal shown
        now = time.monotonic()
        if now - shown < _PACE_OF_LINES:
            return
        shown = now
        left = (now - start) * (1.0 / progress.fraction - 1.0) if progress.fraction > 0.0 else float("nan")
        print(f"{progress.fraction:5.1%}  {_told(progress)}  {left:.0f} s left", file=sys.stderr, flush=True)

    return show


def _told(progress: Progress) -> str:
    return (
        f"{progress.stage}  step {progress.step}  strain {progress.strain:+.3%}  "
        f"residual {progress.residual:.1e}  kinetic {progress.kinetic:.1e} J"
    )


@contextmanager
def notice() -> Iterator[Callable[[float, str], None]]:
    """A function that tells what comes next, on standard error; silent for the first two seconds, a line now and then where there
    is no terminal."""
    start, shown, terminal = time.monotonic(), False, sys.stderr.isatty()
    last = -_PACE_OF_NOTICES

    def tell(share: float, what: str) -> None:
        nonlocal shown, last
        now = time.monotonic()
        if now - start < _QUIET or (not terminal and now - last < _PACE_OF_NOTICES):
            return
        last = now
        line = f"{share:4.0%}  {what}"
        if terminal:
            print(f"\r{line:<60}", end="", file=sys.stderr, flush=True)
        else:
            print(line, file=sys.stderr, flush=True)
        shown = True

    try:
        yield tell
    finally:
        if shown and terminal:
            print(f"\r{'':<60}\r", end="", file=sys.stderr, flush=True)


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """Says on standard error what is going on, once, if it takes long."""
    line = f"{what} ... (where its code is new it is compiled first, and kept for the next time)"
    timer = threading.Timer(_PATIENCE[sys.stderr.isatty()], lambda: print(line, file=sys.stderr, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
