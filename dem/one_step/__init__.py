"""The one-step contact problem: solvers behind one interface, error measures, convex certificates, FCLIB files."""

from .fclib import read_fclib, write_fclib
from .measures import ContactErrors, measure
from .problem import OneStepProblem

__all__ = ["ContactErrors", "OneStepProblem", "measure", "read_fclib", "write_fclib"]
