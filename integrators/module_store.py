"""Generated modules on disk: written once under the hash of the declaration and of what wrote it, imported from there."""

from __future__ import annotations

from types import ModuleType

from ..cache import content_hash, load_text
from ..potentials import Law
from .closed import closed_module
from .declared_text import declared_module
from .dimension import dimension_named
from .key import rooms_hash
from .structure import NoReduction

__all__ = ["load_module", "module_source"]


def module_source(law: Law, dimension: str = "3d") -> str:
    """Text of the generated module, the same on every machine."""
    size = dimension_named(dimension).size
    try:
        return closed_module(law, size=size)
    except NoReduction as reason:
        return declared_module(law, str(reason))


def load_module(law: Law, solver: str = "auto", size: int = 6, formulation: str = "strain") -> ModuleType:
    """Generated module of the law for tensors of `size` components, from memory, else from disk, else written now. The key is formed
    before any differentiation."""
    key = content_hash(law.text, solver, str(size), formulation, rooms_hash())
    return load_text("laws", f"fenchel_law_{law.name}_{key}", lambda: closed_module(law, solver, size, formulation))
