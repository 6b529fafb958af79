"""Compiled code on disk, keyed by content (the ground floor: it imports nothing of ours).

numba keeps a compiled function as long as *its own* file is unchanged, and so serves stale machine code after an edit of a
callee in another file. Here the folder is named by a hash of all sources of the package, of Python, numba and the processor,
so that any edit starts from an empty folder.
"""

from __future__ import annotations

import functools
import hashlib
import os
import platform
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

__all__ = ["cache_folder", "content_hash", "njit", "source_hash"]

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


@functools.cache
def source_hash() -> str:
    """Hash of every source file of the installed package, of the Python version and of the processor."""
    root = Path(__file__).parent
    files = sorted(root.rglob("*.py"))
    parts: list[str | bytes] = [sys.version, platform.machine(), platform.processor()]
    for file in files:
        parts += [str(file.relative_to(root)), file.read_bytes()]
    return content_hash(*parts)


def njit(function: Callable[..., Any] | None = None, /, *, folder: str = "", **options: Any) -> Any:
    """`numba.njit` with the disk cache in a folder named by content (`folder` replaces the hash of our own sources)."""
    if function is None:
        return functools.partial(njit, folder=folder, **options)
    import numba
    from numba.core import config

    options = {"cache": True, "error_model": "numpy", **options}
    place = cache_folder() / "numba" / (folder or source_hash())
    with _decorating:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(place)
        try:
            return numba.njit(**options)(function)
        finally:
            config.CACHE_DIR = before
