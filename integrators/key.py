"""The key of generated code: a hash of the two rooms that write it, and of the versions that compile it."""

from __future__ import annotations

import functools
import platform
import sys
from importlib.metadata import version
from pathlib import Path

from ..cache import content_hash

__all__ = ["files_hash", "kernels_hash", "rooms_hash"]


@functools.cache
def rooms_hash() -> str:
    """Hash of the sources of `potentials` and `integrators`, of Python, sympy, numba and the processor."""
    root = Path(__file__).parent.parent
    parts: list[str | bytes] = [
        sys.version,
        platform.machine(),
        version("sympy"),
        version("numba"),
        version("llvmlite"),
    ]
    for room in ("potentials", "integrators"):
        for file in sorted((root / room).rglob("*.py")):
            if "library" not in file.parts:
                parts += [file.name, file.read_bytes()]
    for file in ("cache.py",):
        parts.append((root / file).read_bytes())
    return content_hash(*parts)


def files_hash(*names: str) -> str:
    """Hash of the named files of this room alone, with the same versions: the key of code that no law and no generator changes."""
    root = Path(__file__).parent
    parts: list[str | bytes] = [
        sys.version,
        platform.machine(),
        platform.processor(),
        version("numba"),
        version("llvmlite"),
    ]
    for file in (*(root / name for name in sorted(names)), root.parent / "cache.py"):
        parts += [file.name, file.read_bytes()]
    return content_hash(*parts)


@functools.cache
def kernels_hash() -> str:
    """Hash of the files whose compiled functions call each other: those that import this function or compile a pointer, and their plan."""
    names = []
    root = Path(__file__).parent
    for file in root.rglob("*.py"):
        data = file.read_bytes()
        if b"import kernels_hash" in data or b"compiled(" in data or file.name == "plan.py":
            names.append(str(file.relative_to(root)))
    return files_hash(*names)
