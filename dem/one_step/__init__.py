"""The one-step contact problem: solvers behind one interface, error measures, convex certificates, FCLIB files."""

from .convex import Certificate, certify
from .fclib import read_fclib, write_fclib
from .measures import ContactErrors, measure
from .problem import OneStepProblem
from .solve import SOLVERS, Solution, solve

__all__ = [
    "SOLVERS",
    "Certificate",
    "ContactErrors",
    "OneStepProblem",
    "Solution",
    "certify",
    "measure",
    "read_fclib",
    "solve",
    "write_fclib",
]
