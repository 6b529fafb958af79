"""Admissibility: is ψ convex and φ* a convex, closed, non-negative function that vanishes at zero? Proved, refuted, or undecided."""

from .check import check
from .conditions import Condition
from .counterexample import CounterExample
from .report import AdmissibilityReport

__all__ = ["AdmissibilityReport", "Condition", "CounterExample", "check"]
