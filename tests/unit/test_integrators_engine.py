"""Parts of the general engine: factorisation, functions of projection Jacobians, the compact form, threads."""

import numpy as np
import pytest

from fenchel.errors import InputError
from fenchel.integrators.batch import CHUNK, run_engine, solve_batch
from fenchel.integrators.canonical import Cone
from fenchel.integrators.cone_blocks import (
    PENALTY,
    SLOPE,
    SPREAD,
    Cones,
    Jacobian,
    add_curvature,
    apply,
    linearise,
    project_all,
)
from fenchel.integrators.cone_projection import EXPONENTIAL, ORTHANT, POWER, SECOND_ORDER, SEMIDEFINITE, project
from fenchel.integrators.general_update import GeneralUpdate
from fenchel.integrators.small_cholesky import factor, substitute
from fenchel.integrators.step_program import StepProgram
from fenchel.potentials.library import LAWS

KINDS = [(ORTHANT, 3, 0.0), (SECOND_ORDER, 5, 0.0), (SEMIDEFINITE, 6, 0.0), (EXPONENTIAL, 3, 0.0), (POWER, 3, 0.3)]


def test_factor_solves():
    rng = np.random.default_rng(0)
    for n in (1, 2, 7, 18, 24):
        root = rng.normal(size=(n, n + 3))
        matrix, right = root @ root.T, rng.normal(size=n)
        lower, found = np.tril(matrix), right.copy()
        factor(lower)
        substitute(lower, found)
        assert found == pytest.approx(np.linalg.solve(matrix, right), rel=1e-9)


def jacobians(v):
    """V by `project` (the identity or zero where it says so), block-diagonal."""
    full, start = np.zeros((v.size, v.size)), 0
    for kind, size, alpha in KINDS:
        rows = slice(start, start + size)
        if kind == ORTHANT:
            full[rows, rows] = np.diag((v[rows] > 0).astype(float))
        else:
            made, out = np.zeros((6, 6)), np.zeros(v.size)
            mark = project(kind, alpha, v, start, size, out, made, np.zeros(60))
            full[rows, rows] = made[:size, :size] if mark == 2 else mark * np.eye(size)
        start += size
    return full


@pytest.mark.parametrize("mode", [PENALTY, SLOPE, SPREAD])
def test_functions_of_the_jacobian_are_those_of_its_eigenvalues(mode):
    rng = np.random.default_rng(mode)
    sizes = np.array([size for _, size, _ in KINDS])
    m, n, tau, delta = int(sizes.sum()), 7, 3.0, 1e-3
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    kinds, alphas = np.array([kind for kind, _, _ in KINDS]), np.array([alpha for *_, alpha in KINDS])
    met = set()
    for _ in range(200):
        G, v, given = rng.normal(size=(m, n)), rng.normal(size=m), rng.normal(size=m)
        v[starts] += rng.normal(size=5)
        grams = np.zeros((5, n, n))
        for b in range(5):
            rows = G[starts[b] + (kinds[b] == SECOND_ORDER) : starts[b] + sizes[b]]
            grams[b] = rows.T @ rows
        cones = Cones(kinds, starts, sizes, G, np.ascontiguousarray(G.T), grams)
        state = Jacobian(
            np.zeros(5, dtype=np.int64),
            np.zeros((5, 6)),
            np.zeros((5, 6, 6)),
            np.zeros((5, 3, 3)),
            np.zeros(m),
            np.zeros(60),
        )
        out = np.zeros(m)
        project_all(cones, alphas, np.zeros(5), 1.0, v, out, state)
        linearise(cones, state)
        met |= {(b, int(mark)) for b, mark in enumerate(state.marks)}
        values, vectors = np.linalg.eigh(jacobians(v))
        values = np.clip(values, 0.0, 1.0)
        function = {
            PENALTY: tau * values,
            SLOPE: tau * values / (1 + delta - values),
            SPREAD: 1 / (1 + delta - values),
        }[mode]
        true = (vectors * function) @ vectors.T
        apply(cones, state, v, mode, tau, delta, given, out)
        assert np.abs(out - true @ given).max() <= 1e-7 * np.abs(function).max()
        if mode != SPREAD:
            matrix = np.zeros((n, n))
            add_curvature(cones, state, v, mode, tau, delta, matrix, np.zeros(n), np.zeros(n))
            assert np.abs(np.tril(G.T @ true @ G) - np.tril(matrix)).max() <= 1e-6 * np.abs(function).max()
    assert len(met) >= 11  # zero, identity and mixed in the blocks that have them


def norms_program():
    """min ½|a|² − d·a + k t,  |(a, r)| ≤ t (r idle), t ≥ 0 said twice more: the shrinkage of d by k."""
    n = 5  # a1 a2 a3, t, r
    G = np.zeros((7, n))
    G[0, 3], G[1, 3], G[2, 3] = -1.0, -2.0, -1.0
    G[3:6, :3] = -np.eye(3)
    G[6, 4] = -1.0
    p = np.array([1.0, 1, 1, 0, 0])
    q1 = np.zeros((n, 6))
    q1[:3, :3] = -np.eye(3)
    q0 = np.array([0.0, 0, 0, 0.5, 0])
    none = np.zeros((0, 6))
    return StepProgram(
        p, G, q0, q1, np.zeros(7), np.zeros((7, 6)), np.zeros((6, 6)), np.zeros(6), 0.0, (Cone(ORTHANT, 2), Cone(SECOND_ORDER, 5)),
        np.zeros(0), none, np.zeros((0, n)), np.zeros(0), none, 0, False, False,
    )  # fmt: skip


def test_compact_form_drops_what_repeats_and_keeps_the_solution():
    program = norms_program()
    small = program.compact.program
    assert [(c.kind, c.size) for c in small.cones] == [(SECOND_ORDER, 4)] and small.p.size == 4
    data = np.random.default_rng(2).normal(size=(300, 6))
    length = np.linalg.norm(data[:, :3], axis=1)
    shrunk = (np.maximum(length - 0.5, 0) / length)[:, None] * data[:, :3]
    for given in (program, small):
        found = run_engine(given, data)
        assert (found.status <= 1).all()
        assert np.abs(found.slopes[:, :3] + shrunk).max() <= 1e-13
    # multipliers of the whole program, carried over, are a start from which hardly a point needs a step
    whole = run_engine(program, data)
    again = run_engine(small, data, start=program.compact.start(whole.y, whole.multipliers))
    assert np.median(again.counts) == 0 and again.counts.max() <= 5
    assert np.abs(again.slopes[:, :3] + shrunk).max() <= 1e-13


def test_threads_change_no_bit():
    program, count = norms_program(), 3 * CHUNK + 17
    data = np.random.default_rng(3).normal(size=(count, 6))
    one, two = solve_batch(program, data), solve_batch(program, data, threads=3)
    for name in ("y", "multipliers", "slopes", "tangent", "residual", "status", "counts"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name


def test_threads_reach_the_update_and_must_be_positive():
    law = LAWS["kelvin_voigt"]
    assert GeneralUpdate.of(law, threads=2).threads == 2
    with pytest.raises(InputError, match="at least 1"):
        GeneralUpdate.of(law, threads=0)
