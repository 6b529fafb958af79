"""The loop of a campaign: what can begin begins, the costliest first; what is over lets others begin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..errors import FenchelError, InputError
from .bars import Bars
from .engines import Engine, WorkerLost, engine_of
from .task import Task, awaited_by

__all__ = ["run_campaign"]

ATTEMPTS = 3  # a task whose workers died this often is given up


def run_campaign(
    tasks: Sequence[Task],
    folder: Path,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    show: bool = True,
    keep_going: bool = False,
    label: str = "all",
) -> dict[str, Any]:
    """Run all tasks and return their results by name; progress files and the tasks' own files are in `folder`.

    `jobs` None: all cores. `scheduler`: the address of a dask scheduler. With `keep_going` a task that fails foreseeably leaves its error
    as its result, as do those that need it; without, the first error stops the campaign. Raises `InputError` for names given twice,
    needs that no task meets, or a scheduler that does not answer.
    """
    table = {task.name: task for task in tasks}
    if len(table) < len(tasks):
        twice = sorted({task.name for task in tasks if sum(other.name == task.name for other in tasks) > 1})
        raise InputError(f"campaign: two tasks are called {twice[0]!r}")
    waiting = {task.name: set(task.needs) for task in tasks}
    unmet = {need for needs in waiting.values() for need in needs} - set(table)
    if unmet:
        raise InputError(f"campaign: no task is called {sorted(unmet)[0]!r}, but others need it")
    folder.mkdir(parents=True, exist_ok=True)
    with Bars(tasks, folder, show=show, label=label) as bars:
        return _Loop(table, waiting, engine_of(jobs, scheduler), bars.finished, keep_going).run()


class _Loop:
    def __init__(
        self,
        table: dict[str, Task],
        waiting: dict[str, set[str]],
        engine: Engine,
        finished: Callable[[Task], None],
        keep_going: bool,
    ) -> None:
        self.table, self.waiting, self.engine = table, waiting, engine
        self.finished, self.keep_going = finished, keep_going
        self.results: dict[str, Any] = {}
        self.running: dict[Any, str] = {}
        self.lost = dict.fromkeys(table, 0)

    def run(self) -> dict[str, Any]:
        try:
            while self.waiting or self.running:
                self._begin()
                if not self.running:
                    raise InputError(f"campaign: {sorted(self.waiting)[0]!r} waits for itself")
                for future in self.engine.wait(self.running):
                    self._take(future)
        except BaseException:
            self.engine.close(kill=True)
            raise
        self.engine.close()
        return {name: self.results[name] for name in self.table}

    def _begin(self) -> None:
        ready = [name for name, needs in self.waiting.items() if not needs]
        for name in sorted(ready, key=lambda name: -self.table[name].cost):
            if len(self.running) >= self.engine.width:
                return
            del self.waiting[name]
            self.running[self.engine.submit(_call, self.table[name], self.engine.caller)] = name

    def _take(self, future: Any) -> None:
        name = self.running.pop(future)
        try:
            self._settle(name, self.engine.result(future))
        except WorkerLost:
            self.lost[name] += 1
            if self.lost[name] >= ATTEMPTS:
                raise FenchelError(
                    f"{name}: its worker died {ATTEMPTS} times (out of memory?): fewer --jobs, or a smaller size"
                ) from None
            self.waiting[name] = set()
        except FenchelError as problem:
            if not self.keep_going:
                raise
            self._settle(name, problem)

    def _settle(self, name: str, result: Any) -> None:
        """Keep a result; a failure is also that of all that needed it."""
        self.results[name] = result
        self.finished(self.table[name])
        for other in [other for other, needs in self.waiting.items() if name in needs]:
            if other not in self.waiting:  # gone with a task that it needed as well
                continue
            if isinstance(result, FenchelError):
                del self.waiting[other]
                self._settle(other, result)
            else:
                self.waiting[other].discard(name)


def _call(task: Callable[[], Any], caller: int | None) -> Any:
    awaited_by(caller)
    return task()
