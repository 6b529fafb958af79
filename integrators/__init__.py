"""Integrators: the implicit step of a declared law as a convex projection, its tangent, and paths of material points."""

from ..errors import ConvergenceError
from .comparison import Comparison, Run, compare
from .comparison_verdict import Verdict
from .conic import ConicSolution, ConicStep, conic_step
from .driver import drive
from .history import History, drive_arrays
from .module_store import module_source
from .path_file import StrainStressPath, read_history, read_path, write_history
from .sensitivity import Sensitivities
from .sensitivity_path import PathSensitivities, path_sensitivities
from .step_order import StepOrder
from .step_result import StepResult
from .stress_update import StressUpdate
from .update import Update, build_update

__all__ = [
    "Comparison",
    "ConicSolution",
    "ConicStep",
    "ConvergenceError",
    "History",
    "PathSensitivities",
    "Run",
    "Sensitivities",
    "StepOrder",
    "StepResult",
    "StrainStressPath",
    "StressUpdate",
    "Update",
    "Verdict",
    "build_update",
    "compare",
    "conic_step",
    "drive",
    "drive_arrays",
    "module_source",
    "path_sensitivities",
    "read_history",
    "read_path",
    "write_history",
]
