"""The polish of conic answers, on programs whose solution is known because the data are built around it."""

import numpy as np
import pytest

from fenchel.integrators.polish import ConeSizes, Program, natural_map, polish

SIZES = ConeSizes(3, 4, (4, 3), (3,))
ROOT = np.sqrt(2.0)


def semidefinite(matrix):
    columns, rows = np.tril_indices(3)
    return matrix[rows, columns] * np.where(rows == columns, 1.0, ROOT)


def complementary_pair(rng, vertex):
    """s in the cones and z in their duals with s·z = 0; at a `vertex` both are zero where they may be (no strict complementarity)."""
    s, z = np.zeros(20), np.zeros(20)
    z[:3] = rng.normal(size=3)
    s[3:5], z[5] = rng.uniform(0.5, 2, size=2), 1.3  # the fourth inequality is weakly active
    u = rng.normal(size=3)
    u /= np.linalg.norm(u)
    s[7:11], z[7:11] = np.r_[1.0, u], 0.7 * np.r_[1.0, -u]
    z[11:14] = 0.0 if vertex else np.r_[1.0, 0.3, 0.2]
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    s[14:] = semidefinite(q @ np.diag([1.0, 0, 0]) @ q.T)
    z[14:] = semidefinite(q @ np.diag([0, 0.0 if vertex else 2.0, 1.0]) @ q.T)
    return s, z


@pytest.mark.parametrize("vertex", [False, True])
def test_the_known_solution_is_reached(vertex):
    rng = np.random.default_rng(5)
    for _ in range(20):
        s, z = complementary_pair(rng, vertex)
        x, A = rng.normal(size=12), rng.normal(size=(20, 12))
        factor = rng.normal(size=(8, 12))
        P = factor.T @ factor  # of rank 8 in 12 unknowns
        program = Program(P, -P @ x - A.T @ z, A, A @ x + s, SIZES)
        assert natural_map(program, x, z) <= 1e-13
        start = x + 1e-4 * rng.normal(size=12), z + 1e-4 * rng.normal(size=20)
        found, _, residual = polish(program, *start, goal=1e-12)
        assert residual <= 1e-9
        assert np.abs(factor @ (found - x)).max() <= 1e-7


def test_a_worse_answer_is_never_returned():
    # no solution: x ≤ −1 and x ≥ 1
    program = Program(np.eye(1), np.zeros(1), np.array([[1.0], [-1.0]]), np.array([-1.0, -1.0]), ConeSizes(0, 2))
    before = natural_map(program, np.zeros(1), np.zeros(2))
    _, _, residual = polish(program, np.zeros(1), np.zeros(2))
    assert 0.1 <= residual <= before
