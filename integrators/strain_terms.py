"""Unilateral energies of the strain alone, added to stress and tangent.

    w ⟨a tr ε + s⟩²          σ += 2 w a ⟨·⟩ I,              tangent += 2 w a² H(·) I⊗I;
    w tr ⟨a ε + s I⟩²        σ += 2 w a (a ε + s I)^≥,      tangent += 2 w a² D[·]^≥.

Coefficients: number of trace terms, number of spectral terms, then (w, a, s) of each.
"""

from __future__ import annotations

from typing import Any

from .kernel_types import LAW_SIGNATURE, compiled
from .spectral import add_positive_derivative, positive_part

__all__ = ["WORK", "unilateral_terms"]

WORK = 32
"""Length of the work row: argument, positive part, eigenvalues and vectors."""


def unilateral_terms() -> Any:
    """The compiled function, a `rest` of a step."""
    return compiled(_add, LAW_SIGNATURE)


def _add(e, s, work, c, want, t):
    o = 2
    for _ in range(int(c[0])):
        w, a, shift = c[o], c[o + 1], c[o + 2]
        o += 3
        value = a * (e[0] + e[1] + e[2]) + shift
        if value > 0.0:
            size = 2.0 * w * a
            for i in range(3):
                s[i] += size * value
                if want:
                    for j in range(3):
                        t[6 * i + j] += size * a
    for _ in range(int(c[1])):
        w, a, shift = c[o], c[o + 1], c[o + 2]
        o += 3
        for i in range(6):
            work[i] = a * e[i]
        for i in range(3):
            work[i] += shift
        positive_part(work, work[12:24], work[6:12])
        for i in range(6):
            s[i] += 2.0 * w * a * work[6 + i]
        if want:
            add_positive_derivative(2.0 * w * a * a, work[12:24], t)
