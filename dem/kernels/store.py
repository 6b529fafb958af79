"""Generated modules on disk: written once under the hash of their text, imported from there, compiled code beside them."""

from __future__ import annotations

from types import ModuleType

from ...cache import content_hash, load_text

__all__ = ["load", "name_of"]

_HEAD = '''"""Written by fenchel.dem.kernels for one kind of scene; do not edit."""

import numpy as np
from numba import prange

from fenchel.cache import njit as cached_njit


def njit(function=None, **options):
    """Compile with the disk cache in a folder of this very text."""
    if function is None:
        return lambda f: njit(f, **options)
    return cached_njit(function, folder=__name__, **options)


'''


def name_of(kind: str, text: str) -> str:
    """Name of the module of a text: its kind and its hash."""
    return f"fenchel_dem_{kind}_{content_hash(_HEAD, text)}"


def load(kind: str, text: str) -> ModuleType:
    """The module of a text, from memory, else from disk, else written now. Raises `StorageError` when the disk refuses."""
    return load_text("kernels", name_of(kind, text), lambda: _HEAD + text)
