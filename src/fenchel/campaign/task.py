"""What a campaign asks of a task, and the small files in which tasks leave their progress."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Protocol

import msgspec

from ..dem.run import Progress

__all__ = ["Task", "awaited_by", "progress_file", "read_progress", "report_progress"]


class Task(Protocol):
    """A plain value that can be pickled to another process. Called, it does its work, or reads what it left when it was done before."""

    @property
    def name(self) -> str:
        """One of a kind in its campaign."""
        ...

    @property
    def cost(self) -> float:
        """Rough share of the whole work."""
        ...

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the tasks that must be finished before."""
        ...

    def __call__(self) -> Any: ...


def progress_file(folder: Path, name: str) -> Path:
    """Where a task of that name leaves its progress."""
    return folder / f".progress-{name.replace(' ', '_').replace(':', '').replace('/', '_')}"


def report_progress(place: Path, progress: Progress) -> None:
    """Leave the present progress in a file, whole or not at all; whoever waits for it gone, stop: the checkpoint stays."""
    if _awaited and os.getppid() not in _awaited:
        os._exit(1)
    part = place.with_suffix(".part")
    part.write_bytes(msgspec.json.encode(progress))
    os.replace(part, place)


_awaited: set[int] = set()


def awaited_by(process: int | None) -> None:
    """Tie the work of this process to another one: when that is gone, a task stops at its next report. None: to nobody."""
    if process is not None and process != os.getpid():
        _awaited.add(process)


def read_progress(place: Path) -> Progress | None:
    """The progress left by a task, if any."""
    try:
        return msgspec.json.decode(place.read_bytes(), type=Progress)
    except (OSError, msgspec.DecodeError):
        return None
