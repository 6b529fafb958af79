"""A task that is one call of a function: its result is kept in a file and read from there the next time."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..dem.storage import load_run, save_run
from ..errors import InputError

__all__ = ["Computation"]


@dataclass(frozen=True)
class Computation:
    """`function(**arguments)` with JSON-like arguments; it returns numbers, strings, arrays and nested dictionaries of these.

    The file is replaced atomically. A file that was made with other arguments or by another function is refused.
    """

    name: str
    function: Callable[..., dict[str, Any]]
    folder: Path
    arguments: Mapping[str, Any] = field(default_factory=dict)
    needs: tuple[str, ...] = ()
    cost: float = 1.0
    in_folder: bool = (
        False  # the function reads what its needs left: it is given `folder=`, on which the result does not depend
    )

    @property
    def run_file(self) -> Path:
        """Where the result is."""
        return self.folder / f"{self.name.replace(' ', '_').replace(':', '').replace('/', '_')}.h5"

    def __call__(self) -> dict[str, Any]:
        """The result, computed or read."""
        settings = {
            "function": f"{self.function.__module__}.{self.function.__qualname__}",
            "arguments": json.loads(json.dumps(dict(self.arguments))),
        }
        if self.run_file.exists():
            content, before = load_run(self.run_file)
            if before != settings:
                raise InputError(f"{self.run_file}: was made with other settings; choose another place, or remove it")
            return content
        place = {"folder": self.folder} if self.in_folder else {}
        result = self.function(**self.arguments, **place)
        save_run(self.run_file, result, settings)
        return load_run(self.run_file)[0]  # the same types, whether computed now or before
