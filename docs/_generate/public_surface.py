"""Which names the page of the Python interface lists, and where: read by the directive `public-names` and by a test, without sphinx."""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path

__all__ = ["listed", "rooms"]


def rooms(page: Path) -> list[str]:
    """The modules that a page names in its directives, in order."""
    return re.findall(r"^\.\. public-names:: (\S+)$", page.read_text(), flags=re.MULTILINE)


def listed(room: str) -> list[tuple[str, str]]:
    """What a room has to itself, in the order of `__all__`: (name, "class", "function" or "data"); nothing that has its path elsewhere."""
    module = importlib.import_module(room)
    found = []
    for name in getattr(module, "__all__", ()):
        item = getattr(module, name)
        kind = "class" if inspect.isclass(item) else "function" if inspect.isroutine(item) else "data"
        # an instance carries the module of its class, which is not its own
        home = (getattr(item, "__module__", None) or room) if kind != "data" else room
        if f"{home}.".startswith(f"{room}."):
            found.append((name, kind))
    return found
