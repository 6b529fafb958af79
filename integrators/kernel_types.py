"""Signatures of the compiled parts of a step, which meet as pointers: what is compiled once per machine never sees a law's own code.

    LAW     law(a, b, d, c, level, out): a generated function of a law, see `reduced_text` and `rest_text`;
    METHOD  method(law, trial, coefficients, first, plan, found, status, count): the reduced projection at `count` points;
    STEP    step(method, law, rest, eps, old, new, stress, tangent, want, dissipation, status, coefficients, plan): the whole step;
            STEP_SIGNATURE_32 is that of arrays of float32.

Arrays have the point index first; a tangent is a row of 36. `coefficients` has one row for all points, or one row per point.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from numba import types

from ..cache import njit
from .key import kernels_hash

__all__ = [
    "LAW",
    "LAW_SIGNATURE",
    "METHOD",
    "METHOD_SIGNATURE",
    "PLACES",
    "ROW",
    "STEP",
    "STEP_SIGNATURE",
    "STEP_SIGNATURE_32",
    "TABLE",
    "TRIAL_SIGNATURE",
    "compiled",
    "no_law",
    "no_method",
]

ROW = types.Array(types.float64, 1, "C")
TABLE = types.Array(types.float64, 2, "C")
PLACES = types.Array(types.int64, 1, "C")

LAW_SIGNATURE = types.void(ROW, ROW, ROW, ROW, types.int64, ROW)
LAW = types.FunctionType(LAW_SIGNATURE)
METHOD_SIGNATURE = types.void(LAW, TABLE, TABLE, types.int64, PLACES, TABLE, PLACES, types.int64)
METHOD = types.FunctionType(METHOD_SIGNATURE)
STEP_SIGNATURE = types.void(
    METHOD, LAW, LAW, TABLE, TABLE, TABLE, TABLE, TABLE, types.int64, ROW, PLACES, TABLE, PLACES
)
STEP = types.FunctionType(STEP_SIGNATURE)
TRIAL_SIGNATURE = types.void(TABLE, TABLE, TABLE, TABLE, TABLE, TABLE)
ROW_32 = types.Array(types.float32, 1, "C")
TABLE_32 = types.Array(types.float32, 2, "C")
STEP_SIGNATURE_32 = types.void(
    METHOD, LAW, LAW, TABLE_32, TABLE_32, TABLE_32, TABLE_32, TABLE_32, types.int64, ROW_32, PLACES, TABLE, PLACES
)


@functools.cache
def compiled(function: Callable[..., Any], signature: Any) -> Any:
    """The function compiled (or read from disk) for one signature, when it is first asked for."""
    return njit(folder=kernels_hash(), signature_or_function=signature, nogil=True)(function)


def _no_law(a, b, d, c, level, out):
    """Stands where a law has no function of its own."""


def _no_method(law, trial, coefficients, first, plan, found, status, count):
    """Stands where the step needs no method."""


def no_law() -> Any:
    """Pointer to a function that does nothing."""
    return compiled(_no_law, LAW_SIGNATURE)


def no_method() -> Any:
    """Pointer to a method that does nothing."""
    return compiled(_no_method, METHOD_SIGNATURE)
