"""Mixed control with the roles turned: the stresses are the unknowns, and a prescribed strain is a condition on the answer.

A component whose stress is prescribed is given; one whose strain is prescribed has an unknown stress, tested by its strain. Normal
components without prescription share one unknown stress; their condition is the volume strain, or the mean pressure, which then is a
relation between stresses alone. Without pressure and without prescribed normal stress beside a volume strain the system is the gradient
of W_n*(σ) − σ:ε̄.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["stress_plan"]

Array = NDArray[np.float64]


def stress_plan(
    stressed: NDArray[np.bool_], free: NDArray[np.bool_], goals: Array, trace: str | None, condition: Array
) -> tuple[Array, Array, Array, Array, bool]:
    """(base, goal, Z, V, symmetric) of V ε(base + Z y) = goal: `stressed` (6,) where the stress is prescribed, `free` (6,) the normal
    components without prescription, `goals` (n, 6) prescribed values, `condition` (n,) of the `trace`."""
    unit, ball = np.eye(6), np.where(free, 1.0, 0.0)
    base = np.where(stressed & ~free, goals, 0.0)
    strained = np.flatnonzero(~stressed & ~free)
    columns, rows = [unit[i].copy() for i in strained], [unit[i] for i in strained]
    goal = [goals[:, i] for i in strained]
    symmetric = True
    if trace == "p":
        # −tr σ/3 = p: what the free ones carry is left by the others
        count = ball.sum()
        base += ((-3.0 * condition - base[:, :3].sum(axis=1)) / count)[:, None] * ball
        for k, i in enumerate(strained):
            if i < 3:
                columns[k] -= ball / count
                symmetric = False
    elif trace == "eps_v":
        given = [i for i in strained if i < 3]
        row = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        row[given] = 0.0
        columns.append(ball)
        rows.append(row)
        goal.append(condition - goals[:, given].sum(axis=1))
        symmetric = not (stressed & ~free)[:3].any()
    count = len(columns)
    z, v = np.array(columns).T.reshape(6, count), np.array(rows).reshape(count, 6)
    found = np.array(goal).T.reshape(len(goals), count)
    arrays = [np.ascontiguousarray(a) for a in (base, found, z, v)]
    return arrays[0], arrays[1], arrays[2], arrays[3], symmetric
