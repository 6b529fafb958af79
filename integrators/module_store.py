"""Generated modules on disk: written once under the hash of the declaration and of what wrote it, imported from there."""

from __future__ import annotations

import importlib.util
import os
import sys
import tempfile
from pathlib import Path
from types import ModuleType

from ..cache import cache_folder, content_hash
from ..errors import InputError, StorageError
from ..potentials import Law
from .closed import closed_module
from .declared_text import declared_module
from .key import rooms_hash
from .structure import NoReduction

__all__ = ["load_module", "module_source"]


def module_source(law: Law, dimension: str = "3d") -> str:
    """Text of the generated module, the same on every machine."""
    if dimension != "3d":
        raise InputError(f"dimension {dimension!r} is not available; it is '3d'")
    try:
        return closed_module(law)
    except NoReduction as reason:
        return declared_module(law, str(reason))


def load_module(law: Law, solver: str = "auto", formulation: str = "strain") -> ModuleType:
    """Generated module of the law, from memory, else from disk, else written now. The key is formed before any differentiation."""
    key = content_hash(law.text, solver, formulation, rooms_hash())
    name = f"fenchel_law_{law.name}_{key}"
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / "laws" / f"{name}.py"
    if not path.is_file():
        _write(path, closed_module(law, solver, formulation))
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


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(temporary, path)
    except OSError as error:
        raise StorageError(
            f"cannot write generated code to {path.parent}: {error.strerror}; set FENCHEL_CACHE to another folder"
        ) from error
