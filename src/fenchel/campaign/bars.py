"""Progress of the tasks of a campaign: bars with step, strain, residual and time left, read from the files the tasks leave."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Protocol

from .task import progress_file, read_progress

__all__ = ["Bars"]


SURE = 0.05  # share of the work below which no time left is told: the first tasks compile


class _Named(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def cost(self) -> float: ...


class Bars:
    """A context in which finished work and the tasks at work are shown; on a terminal as bars, elsewhere as a line now and then."""

    def __init__(
        self, tasks: Sequence[_Named], folder: Path, *, show: bool = True, pace: float = 15.0, label: str = "all"
    ) -> None:
        self.tasks = list(tasks)
        self.folder = folder
        self.show = show
        self.pace = pace
        self.label = label
        self.done: set[str] = set()
        self.started = time.monotonic()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Bars:
        for task in self.tasks:
            progress_file(self.folder, task.name).unlink(missing_ok=True)
        if self.show:
            self._thread = threading.Thread(target=self._watch, daemon=True)
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        for task in self.tasks:
            progress_file(self.folder, task.name).unlink(missing_ok=True)

    def finished(self, task: _Named) -> None:
        """A task is over."""
        self.done.add(task.name)

    def _state(self) -> tuple[float, list[tuple[str, float, str]]]:
        """Share of the whole work that is done, and the tasks at work: name, fraction, what they say."""
        total = sum(task.cost for task in self.tasks)
        behind = 0.0
        busy = []
        for task in self.tasks:
            if task.name in self.done:
                behind += task.cost
                continue
            progress = read_progress(progress_file(self.folder, task.name))
            if progress is not None:
                behind += task.cost * progress.fraction
                text = f"{progress.stage}, step {progress.step}, strain {100 * progress.strain:+.3f} %, residual {progress.residual:.0e}"
                busy.append((task.name, progress.fraction, text))
        return behind / total, busy

    def _left(self, share: float) -> str:
        """Time left by rule of three."""
        if share < SURE:
            return "–"
        seconds = int((time.monotonic() - self.started) * (1.0 - share) / share)
        return f"{seconds // 60}:{seconds % 60:02d}"

    def _watch(self) -> None:
        from rich.console import Console
        from rich.live import Live
        from rich.table import Table

        console = Console(stderr=True)
        if not console.is_terminal:
            while not self._stop.wait(self.pace):
                share, busy = self._state()
                text = "; ".join(f"{name} ({said})" for name, _, said in busy)
                print(f"{100 * share:3.0f} %, {self._left(share)} left: {text}", file=sys.stderr, flush=True)
            return
        from rich.progress_bar import ProgressBar

        def view() -> Table:
            share, busy = self._state()
            table = Table.grid(padding=(0, 1))
            table.add_row(
                self.label,
                ProgressBar(total=1.0, completed=share, width=30),
                f"{100 * share:.0f} %, {self._left(share)} left",
            )
            for name, fraction, said in busy:
                table.add_row(name, ProgressBar(total=1.0, completed=fraction, width=30), said)
            return table

        with Live(view(), console=console, refresh_per_second=4, transient=True) as live:
            while not self._stop.wait(0.25):
                live.update(view())
