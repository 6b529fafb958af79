"""Integrators: the implicit step of a declared law as a convex projection, its tangent, and paths of material points."""

from ..errors import ConvergenceError
from .history import History, drive_arrays
from .module_store import module_source
from .update import StepResult, Update, build_update

__all__ = ["ConvergenceError", "History", "StepResult", "Update", "build_update", "drive_arrays", "module_source"]
