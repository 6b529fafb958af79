"""Errors and statuses that every room shares (the ground floor: it imports nothing of ours).

A message is one line: what is wrong, the rule it breaks, what to do instead. The command line prints it and leaves with
`exit_code`.
"""

from __future__ import annotations

from enum import IntEnum

__all__ = [
    "ConvergenceError",
    "DeclarationError",
    "FenchelError",
    "InputError",
    "Status",
    "StorageError",
]


class Status(IntEnum):
    """Outcome of one point, step or run. Only `CONVERGED` may leave a solver without raising (unless asked for)."""

    CONVERGED = 0
    ITERATION_LIMIT = 1
    NOT_FINITE = 2
    INFEASIBLE = 3


class FenchelError(Exception):
    """Any failure that fenchel foresees; the text is one line that a user can act on."""

    exit_code = 1


class InputError(FenchelError):
    """Bad input: a file, a value or a call that breaks a stated rule. Exit code 2."""

    exit_code = 2


class DeclarationError(InputError):
    """A law whose declaration breaks a rule (unknown symbol, rank mismatch, softening, ...)."""


class ConvergenceError(FenchelError):
    """A solver stopped above its tolerance. Recoverable: cut the step, raise the limit, or loosen the tolerance."""


class StorageError(FenchelError):
    """A file could not be written (no space, no permission). What was written before is untouched."""
