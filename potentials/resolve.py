"""Find a law: by its name in the library, or as `file.py:name`.

A law file is Python and is run as such, with the rights of the user; do not run a law file that you would not run as a program.
"""

from __future__ import annotations

import runpy
from difflib import get_close_matches
from pathlib import Path

from ..errors import FenchelError, InputError
from .law import Law

__all__ = ["load_law"]


def load_law(where: str) -> Law:
    """Law from the library (`"texsol"`) or from a Python file (`"my_laws.py:clay"`). `InputError` says what was not found."""
    from .library import LAWS

    text = str(where)
    if text in LAWS:
        return LAWS[text]
    place, colon, name = text.rpartition(":")
    if not colon or not place or not name:
        if text.endswith(".py") and Path(text).is_file():
            raise InputError(f"{text!r} is a file: write {text}:NAME, with the name that the law has in it")
        near = get_close_matches(text.lower().replace("-", "_"), LAWS, n=1, cutoff=0.7)
        meant = f"do you mean {near[0]!r}? " if near else ""
        raise InputError(
            f"no law is called {text!r}; {meant}The library has: {', '.join(LAWS)}; a law file is given as file.py:name"
            if near
            else f"no law is called {text!r}; the library has: {', '.join(LAWS)}; a law file is given as file.py:name"
        )
    path = Path(place)
    if not path.is_file():
        raise InputError(f"law file {place!r} does not exist or is not a file")
    try:
        found = runpy.run_path(str(path))
    except FenchelError as error:
        raise InputError(f"law file {place!r}: {error}") from error
    except SystemExit as error:
        raise InputError(f"law file {place!r} leaves Python when run (SystemExit {error.code})") from error
    except Exception as error:
        line = str(error).splitlines()[0] if str(error) else ""
        raise InputError(f"law file {place!r} fails when run: {type(error).__name__}: {line}") from error
    law = found.get(name)
    laws = [key for key, value in found.items() if isinstance(value, Law)]
    if not isinstance(law, Law):
        problem = "has no law" if name not in found else "holds something that is not a Law under the name"
        raise InputError(f"law file {place!r} {problem} {name!r}; its laws: {', '.join(laws) or 'none'}")
    return law
