"""The invariants that a potential is written in, gathered from their atoms."""

from __future__ import annotations

from .atoms.atom import Invariant
from .atoms.eig_max import EigMaxLeaf, eig_max
from .atoms.eig_min import EigMinLeaf, eig_min
from .atoms.eig_sum import EigSumLeaf, eig_sum
from .atoms.inner import InnerLeaf, inner
from .atoms.norm import NormLeaf, norm
from .atoms.positive_part import pos
from .atoms.positive_square import PositiveSquareLeaf
from .atoms.positive_trace import PositiveTraceLeaf
from .atoms.trace import TraceLeaf, tr

__all__ = [
    "EigMaxLeaf",
    "EigMinLeaf",
    "EigSumLeaf",
    "InnerLeaf",
    "Invariant",
    "NormLeaf",
    "PositiveSquareLeaf",
    "PositiveTraceLeaf",
    "TraceLeaf",
    "eig_max",
    "eig_min",
    "eig_sum",
    "inner",
    "norm",
    "pos",
    "tr",
]
