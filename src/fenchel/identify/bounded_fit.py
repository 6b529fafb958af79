"""Least squares within bounds: damped Gauss–Newton on the free unknowns, projected.

    min ½‖r(y)‖²,  0 ≤ y ≤ u.

At y the unknowns that sit on a bound with the gradient pointing outwards are held (active set); on the others the step solves
(JᵀJ + λ diag JᵀJ) s = −Jᵀr and y + s is projected onto the box. λ falls after a success and grows after a failure (Marquardt 1963). The
residuals of a law have kinks in its parameters; a step that shrinks to nothing is then a minimum as well. An unknown may
end exactly on its bound, which the report must be able to say.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError

__all__ = ["bounded_least_squares", "difference_columns"]

Array = NDArray[np.float64]
DIFFERENCE = 1e-5
STEPS = 100


def difference_columns(residual: Callable[[Array], Array], y: Array, centre: Array, upper: Array) -> Array:
    """Forward (at the upper bound: backward) differences of `residual` at y, where it is `centre`; shape (point_count, len(y))."""
    out = []
    for k in range(len(y)):
        h = DIFFERENCE if y[k] + DIFFERENCE <= upper[k] else -DIFFERENCE
        shifted = y.copy()
        shifted[k] += h
        out.append((residual(shifted) - centre) / h)
    return np.stack(out, axis=1)


def bounded_least_squares(
    residual: Callable[[Array], Array],
    start: Array,
    upper: Array,
    *,
    xtol: float = 1e-6,
    ftol: float = 1e-8,
    what: str = "the hardening",
) -> Array:
    """Minimiser y of ½‖residual(y)‖² on 0 ≤ y ≤ `upper`, from `start`; unknowns scaled to order one.

    Stops when an accepted step is below `xtol`, gains less than `ftol` of the cost, no descent is left, or all unknowns are held.
    Raises `ConvergenceError` after `STEPS` Jacobians; `what` is fitted, for its message.
    """
    y = np.clip(start, 0.0, upper)
    r = residual(y)
    cost = float(r @ r)
    damping = 1e-3
    for _ in range(STEPS):
        if cost == 0.0:
            return y
        jacobian = difference_columns(residual, y, r, upper)
        gradient = jacobian.T @ r
        free = ~(((y <= 0.0) & (gradient >= 0.0)) | ((y >= upper) & (gradient <= 0.0)))
        normal = jacobian[:, free].T @ jacobian[:, free]
        diagonal = np.diag(normal)
        if not free.any() or not np.any(diagonal > 0.0):
            return y
        weight = np.diag(np.maximum(diagonal, 1e-12 * diagonal.max()))
        while True:
            trial = y.copy()
            trial[free] -= np.linalg.solve(normal + damping * weight, gradient[free])
            trial = np.clip(trial, 0.0, upper)
            step = float(np.max(np.abs(trial - y)))
            if step <= xtol:
                return y
            r_trial = residual(trial)
            cost_trial = float(r_trial @ r_trial)
            if cost_trial < cost:
                break
            damping = min(damping * 5.0, 1e12)
        gain = cost - cost_trial
        y, r, cost = trial, r_trial, cost_trial
        damping = max(damping / 5.0, 1e-12)
        if gain <= ftol * cost:
            return y
    raise ConvergenceError(f"the fit of {what} did not settle in {STEPS} steps (misfit {np.sqrt(cost):.2e})")
