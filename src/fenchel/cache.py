"""Compiled code on disk, keyed by content (the ground floor: it imports nothing of ours but the errors).

numba keeps a compiled function as long as *its own* file is unchanged, and so serves stale machine code after an edit of a
callee in another file. Here the folder is named by a hash of all sources of the package, of Python, numba and the processor,
so that any edit starts from an empty folder.
"""

from __future__ import annotations

import errno
import functools
import hashlib
import importlib.util
import os
import platform
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from .errors import InputError, StorageError

__all__ = ["cache_folder", "content_hash", "load_text", "njit", "replace_file", "source_hash"]

_decorating = threading.RLock()


def content_hash(*texts: str | bytes) -> str:
    """Twenty hexadecimal digits that name the given texts, in order."""
    digest = hashlib.sha256()
    for text in texts:
        data = text.encode() if isinstance(text, str) else text
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()[:20]


def cache_folder() -> Path:
    """The user's cache folder of fenchel; the environment variable FENCHEL_CACHE overrides it."""
    given = os.environ.get("FENCHEL_CACHE")
    if given:
        return Path(given)
    import platformdirs

    return Path(platformdirs.user_cache_dir("fenchel"))


def replace_file(path: Path | str, data: bytes) -> None:
    """Write `data` so that `path` holds either its old or its new content, never a part; `StorageError` if it cannot."""
    path = Path(path).resolve()  # through a link, so that the link stays one
    temporary = None
    if path.exists() and not path.is_file():
        raise StorageError(f"{path}: is a folder or a device, not a file; choose a file name")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        if error.errno in (errno.EEXIST, errno.ENOTDIR, errno.ENOENT):  # of the folders above it
            raise InputError(
                f"{path}: {path.parent} is not a folder and cannot be made one: choose another place"
            ) from None
        room = "free some space or " if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG) else ""
        raise StorageError(
            f"{path}: could not be written ({error.strerror or error}); what was there before is untouched: {room}choose another place"
        ) from None


def load_text(folder: str, name: str, text: Callable[[], str]) -> ModuleType:
    """Module of generated code from memory, else from `folder` of the cache, else written there now; `name` must be a hash of all that made
    it. Raises `StorageError` when the disk refuses."""
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / folder / f"{name}.py"
    if not path.is_file():
        whole = text()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(whole)
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


@functools.cache
def source_hash(room: str) -> str:
    """Hash of every source that code of a room can call, of the Python version and of the processor.

    A room calls itself, the rooms below it and the ground floor (the import contract), so an edit elsewhere keeps its code warm.
    """
    root = Path(__file__).parent
    folders = [root / room] if room else [root]
    folders += [root / below for below in _BELOW.get(room, ())]
    files = sorted({file for folder in folders for file in folder.rglob("*.py")} | {Path(__file__)})
    parts: list[str | bytes] = [sys.version, platform.machine(), platform.processor()]
    for file in files:
        parts += [str(file.relative_to(root)), file.read_bytes()]
    return content_hash(*parts)


_BELOW = {"integrators": ("potentials",), "identify": ("potentials", "integrators", "dem")}


def _room(function: Callable[..., Any]) -> str:
    """The room of a function by its module name; "" (everything) outside the rooms."""
    parts = function.__module__.split(".")
    return parts[1] if len(parts) > 2 and parts[0] == "fenchel" else ""


def _told_apart(function: Any) -> None:
    """Give a closure a name of its own, by what it closes over.

    numba names the symbol of a function by its qualified name and a counter of the process that compiled it. Two variants of a closure
    that different processes compiled can share that name, and then a process that reads both from disk runs the one for the other.
    """
    if not function.__closure__:
        return
    parts = []
    for name, cell in zip(function.__code__.co_freevars, function.__closure__, strict=True):
        value = cell.cell_contents
        called = getattr(
            value, "py_func", value
        )  # a compiled function goes by its name, which tells its own variants apart
        if callable(called):
            parts.append(f"{name}={called.__module__}.{called.__qualname__}")
        elif isinstance(value, (bool, int, float, str, bytes, tuple, type(None))):
            parts.append(f"{name}={value!r}")
        else:
            raise TypeError(
                f"{function.__qualname__} closes over {name} of type {type(value).__name__}, which has no stable text"
            )
    function.__qualname__ += "_" + content_hash(*parts)


def njit(function: Callable[..., Any] | None = None, /, *, folder: str = "", **options: Any) -> Any:
    """`numba.njit` with the disk cache in a folder named by content (`folder` replaces the hash of our own sources); variants of a
    closure are told apart."""
    if function is None:
        return functools.partial(njit, folder=folder, **options)
    _told_apart(function)
    import numba
    from numba.core import config as settings

    config: Any = settings  # its attributes are made at run time

    options = {"cache": True, "error_model": "numpy", **options}
    place = cache_folder() / "numba" / (folder or source_hash(_room(function)))
    with _decorating:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(place)
        try:
            return numba.njit(**options)(function)
        finally:
            config.CACHE_DIR = before
