"""Generated modules on disk: written once under the hash of their text, imported from there, compiled code beside them."""

from __future__ import annotations

import importlib.util
import os
import sys
import tempfile
from types import ModuleType

from ...cache import cache_folder, content_hash
from ...errors import StorageError

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
    name = name_of(kind, text)
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / "kernels" / f"{name}.py"
    if not path.is_file():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(_HEAD + text)
            os.replace(temporary, path)
        except OSError as error:
            raise StorageError(
                f"cannot write generated code to {path.parent}: {error.strerror}; set FENCHEL_CACHE to another folder"
            ) from error
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
