"""One-step problems against closed forms, least squares, cone programs, measures in plain Python, and velocities stored by other codes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from contact_families import boxes, natural_maps, spheres, wedge
from scipy.optimize import nnls
from scipy.sparse.linalg import spsolve

from fenchel.dem import Assembly, Drive, Material, Simulation, Solver
from fenchel.dem.one_step import SOLVERS, OneStepProblem, certify, measure, read_fclib, solve, write_fclib
from fenchel.dem.one_step.blocks import scaled_blocks
from fenchel.dem.one_step.convex import ConeProgram
from fenchel.dem.one_step.fclib import stored_velocity
from fenchel.dem.one_step.feasibility import check_infeasibility, find_infeasibility, interior_velocity
from fenchel.dem.one_step.linear import BlockSystem
from fenchel.dem.one_step.measures import onto_cone
from fenchel.dem.one_step.scenes import problem_of
from fenchel.dem.packing import densify
from fenchel.errors import ConvergenceError, InputError, Status

FILES = Path(__file__).parents[3] / "shared" / "fclib" / "selection"
# the best natural_map_q of Siconos 4.4 and its time [s] (table beside the files); None: no peer was run
PEERS = {
    "CubeH8": None,
    "Rover11035": None,
    "Rover1040": None,
    "LMGC_GlobalFrictionContactProblem00046": None,
    "NESpheres_10_1": None,
    "OneObject-i100000-499": (2.8e-9, 3e-3),
    "NESpheres_30_1": (0.0, 1e-4),
    "fclib_local_problem_test": (5.8e-9, 1.3),
    "BoxesStack1-i100000-32": (3.0e-9, 0.92),
    "LMGC_100_PR_PerioBox-i00361-60-03000": (4.6e-8, 20e-3),
    "Box_Stacks-i0122-82-5": (5.0e-9, 1.2e-3),
    "Confeti-ex13-Fc3D-SBM": (1.3e-9, 2e-3),
    "spheres-in-a-box-98-i10000-256-10": (3.7e-9, 0.47),
    "Capsules-i125-1213": (2.7e-10, 0.23),
    "Spheres-i099-356-679": (4.3e-12, 8e-3),
    "KaplasTower-i1061-4": (1.0e-8, 0.24),
}
beside = pytest.mark.skipif(not FILES.is_dir(), reason="the FCLIB selection does not lie beside the checkout")


def of(family: dict) -> OneStepProblem:
    return OneStepProblem.of_bodies(**family)


def judged(problem: OneStepProblem, r: np.ndarray) -> float:
    return max(natural_maps(problem.delassus.toarray(), problem.q, problem.mu, r))


# --- one contact, in closed form


def one(q: list[float], mu: float) -> np.ndarray:
    return solve(OneStepProblem.local(np.diag([2.0, 7.0, 7.0]), q, [mu]), tolerance=1e-12).r


def test_one_contact_opens_sticks_and_slides_as_in_closed_form() -> None:
    assert np.array_equal(one([0.5, 3.0, -1.0], 0.4), np.zeros(3))
    assert np.allclose(one([-2.0, 0.5, 0.0], 0.4), [1.0, -0.5 / 7.0, 0.0], atol=1e-11)
    assert np.allclose(one([-2.0, 30.0, -40.0], 0.4), [1.0, -0.24, 0.32], atol=1e-11)
    assert np.allclose(one([-2.0, 30.0, -40.0], 0.0), [1.0, 0.0, 0.0], atol=1e-11)


def test_a_coupled_sliding_contact_satisfies_coulombs_law() -> None:
    w = np.array([[2.0, 0.9, -0.4], [0.9, 3.0, 0.2], [-0.4, 0.2, 5.0]])
    r = solve(OneStepProblem.local(w, [-1.0, 2.0, 1.0], [0.3]), tolerance=1e-12).r
    u = w @ r + [-1.0, 2.0, 1.0]
    assert abs(u[0]) < 1e-12
    assert np.hypot(r[1], r[2]) == pytest.approx(0.3 * r[0], rel=1e-11)
    assert u[1] * r[2] - u[2] * r[1] == pytest.approx(0.0, abs=1e-11)
    assert u[1:] @ r[1:] < 0.0


# --- the measures, against plain Python


def test_the_measures_are_those_of_plain_python() -> None:
    rng = np.random.default_rng(1)
    for mu in (0.0, 0.3, 2.0):
        problem = of(spheres(3, 2, mu=mu))
        for size in (1e-3, 1.0, -1.0):
            r = size * rng.standard_normal(len(problem.q))
            errors = measure(problem, r)
            plain, scaled = natural_maps(problem.delassus.toarray(), problem.q, problem.mu, r)
            assert (errors.natural_map_q, errors.natural_map_scaled) == pytest.approx((plain, scaled), rel=1e-12)


def test_the_projection_is_the_nearest_point() -> None:
    rng = np.random.default_rng(2)
    mu = np.array([0.0, 0.2, 1.0, 5.0])
    inside = onto_cone(rng.standard_normal(12) + np.tile([3.0, 0.0, 0.0], 4), mu)
    for _ in range(200):
        z = rng.standard_normal(12) * rng.choice([0.1, 1.0, 10.0])
        foot = onto_cone(z, mu)
        assert np.all(np.hypot(foot[1::3], foot[2::3]) <= mu * foot[0::3] * (1.0 + 1e-14) + 1e-300)
        for k in range(4):  # (z − Pz)·(w − Pz) ≤ 0 on the cone, equality for w = 0 and w = 2 Pz
            part = slice(3 * k, 3 * k + 3)
            assert (z - foot)[part] @ foot[part] == pytest.approx(0.0, abs=1e-13 * (1.0 + z @ z))
            assert (z - foot)[part] @ inside[part] <= 1e-13 * (1.0 + z @ z)
    assert np.array_equal(onto_cone(np.array([-1.0, 0.0, 0.0]), np.zeros(1)), np.zeros(3))


# --- families


@pytest.mark.parametrize("mu", [0.0, 0.1, 0.5, 0.7])
@pytest.mark.parametrize("seed", [0, 1])
def test_sphere_packings(seed: int, mu: float) -> None:
    problem = of(spheres(seed, 4, mu=mu))
    solution = solve(problem)
    assert judged(problem, solution.r) <= 1e-8
    assert np.count_nonzero(solution.r[0::3]) > 50


@pytest.mark.parametrize("ratio", [1e-4, 1e2])
def test_heavy_and_light_grains_on_top(ratio: float) -> None:
    problem = of(spheres(0, 3, mass_ratio=ratio))
    assert judged(problem, solve(problem).r) <= 1e-8
    tower = of(boxes(8, mass_ratio=ratio))
    assert judged(tower, solve(tower).r) <= 1e-8


@pytest.mark.parametrize("mu", [0.0, 0.1, 0.7, 10.0, 1e3])
def test_hyperstatic_towers_have_the_velocities_of_the_cone_program(mu: float) -> None:
    problem = of(boxes(10, mu=mu))
    solution = solve(problem)
    assert judged(problem, solution.r) <= 1e-8
    certificate = certify(problem, solution.r)
    assert certificate.certified, certificate
    assert np.linalg.matrix_rank(problem.delassus.toarray(), tol=1e-10) <= 60 < len(problem.q)


@pytest.mark.parametrize("mu", [0.0, 0.3, 1.0, 10.0])
def test_a_sphere_in_a_groove(mu: float) -> None:
    """Pushed along the groove with spin; without friction the normal impulses follow from two equations."""
    problem = of(wedge(mu))
    solution = solve(problem, tolerance=1e-12)
    assert judged(problem, solution.r) <= 1e-12
    if mu == 0.0:
        dense = problem.delassus.toarray()
        exact = np.linalg.solve(dense[0::3, 0::3], -problem.q[0::3])
        assert np.all(exact > 0.0)
        assert np.allclose(solution.r[0::3], exact, rtol=1e-11)


def test_without_friction_the_answer_is_that_of_non_negative_least_squares() -> None:
    """W = AᵀA with A = M^(−1/2) H_N and q = Aᵀb: min ½‖A x + b‖² over x ≥ 0, by the active sets of Lawson and Hanson."""
    family = spheres(2, 3, mu=0.0)
    family["w"][:] = 0.0
    problem = of(family)
    root = np.sqrt(family["mass"].diagonal())
    a, b = family["h"][:, 0::3].toarray() / root[:, None], family["f"] / root
    x, _ = nnls(a, -b, maxiter=10_000)
    solution = solve(problem, tolerance=1e-11)
    exact = problem.delassus[0::3, 0::3] @ x + problem.q[0::3]
    assert np.allclose(solution.u[0::3], exact, atol=1e-9 * np.abs(problem.q).max())
    assert np.all(solution.r.reshape(-1, 3)[:, 1:] == 0.0)


def test_a_problem_that_opens_everywhere_has_no_reaction() -> None:
    family = spheres(0, 3)
    family["w"][0::3] += 10.0
    solution = solve(of(family))
    assert solution.converged
    assert (np.count_nonzero(solution.r), solution.sweeps, solution.factorisations) == (0, 0, 0)
    assert solution.errors.natural_map_scaled == 0.0


# --- invariance


@pytest.mark.parametrize(("force", "velocity"), [(1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6), (1e-6, 1e6)])
def test_units_do_not_matter(force: float, velocity: float) -> None:
    """W in velocity/force, q in velocity: the scaled measure and the work done are the same in any units."""
    plain = of(boxes(5))
    other = OneStepProblem.local(plain.delassus * (velocity / force), plain.q * velocity, plain.mu)
    first, second = solve(plain), solve(other, keep_unconverged=True)
    assert second.errors.natural_map_scaled <= 1e-8
    assert np.allclose(first.u, second.u / velocity, atol=1e-7)
    # natural_map_q mixes forces and velocities: in other units it is another number, possibly out of reach of round-off
    assert second.converged or second.errors.natural_map_q > 1e-8


def test_the_order_of_contacts_and_the_frames_do_not_matter() -> None:
    family = boxes(6)
    problem = of(family)
    rng = np.random.default_rng(3)
    order = rng.permutation(problem.contact_count)
    turn = np.zeros((len(problem.q), len(problem.q)))
    for new, old in enumerate(order):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        c, s = np.cos(angle), np.sin(angle)
        turn[3 * new : 3 * new + 3, 3 * old : 3 * old + 3] = [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]
    moved = OneStepProblem.local(turn @ problem.delassus.toarray() @ turn.T, turn @ problem.q, problem.mu[order])
    assert np.allclose(solve(moved).u, turn @ solve(problem).u, atol=1e-7)


def test_an_asymmetric_operator_is_solved_as_given() -> None:
    rng = np.random.default_rng(4)
    problem = of(boxes(4, mu=0.4))
    skew = rng.standard_normal((len(problem.q), len(problem.q)))
    given = OneStepProblem.local(
        problem.delassus.toarray() + 2e-3 * (skew - skew.T) + 1e-2 * np.eye(len(skew)), problem.q, problem.mu
    )
    assert not given.symmetric
    assert judged(given, solve(given).r) <= 1e-8
    with pytest.raises(InputError, match="not symmetric"):
        solve(given, solver="cone_program")
    with pytest.raises(InputError, match="not symmetric"):
        certify(given, np.zeros(len(skew)))


# --- claims


@pytest.mark.parametrize("solver", SOLVERS)
def test_no_solver_claims_what_it_did_not_reach(solver: str) -> None:
    claims = 0
    for family in (boxes(2), wedge(0.5), boxes(1, mu=0.0), wedge(0.3, squeeze=0.1), spheres(5, 2, mu=3.0)):
        problem = of(family)
        for tolerance in (1e-3, 1e-8, 1e-13):
            solution = solve(problem, solver=solver, tolerance=tolerance, time_limit=0.1, keep_unconverged=True)
            assert np.all(np.isfinite(solution.r))
            assert solution.errors.reaction_violation < 1e-12
            if solution.converged:
                claims += 1
                assert judged(problem, solution.r) <= 1.03 * tolerance  # of round-off
            else:
                assert solution.status in (Status.ITERATION_LIMIT, Status.INFEASIBLE)
                assert solution.errors.worst > tolerance
    assert claims >= 1


def test_the_solvers_agree_on_velocities() -> None:
    problem = of(boxes(4))
    velocities = [solve(problem, solver=solver, tolerance=1e-7, time_limit=20.0).u for solver in SOLVERS]
    for u in velocities[1:]:
        assert np.allclose(u, velocities[0], atol=1e-5)


def test_a_wrong_reaction_is_not_certified() -> None:
    problem = of(boxes(4))
    r = solve(problem).r
    assert certify(problem, r).certified
    assert not certify(problem, 1.01 * r).certified
    assert not certify(problem, 0.0 * r).certified


def test_cvxpy_and_clarabel_find_the_same_optimum() -> None:
    problem = of(spheres(1, 2, mu=0.3))
    s = np.linspace(0.0, 0.1, problem.contact_count)
    programs = [ConeProgram(problem, through) for through in ("clarabel", "cvxpy")]
    values = [program.objective(program.solve(s), s)[0] for program in programs]
    assert values[0] == pytest.approx(values[1], rel=1e-8)
    assert values[0] < 0.0
    with pytest.raises(InputError, match="clarabel or cvxpy"):
        ConeProgram(problem, "magic")


# --- no solution


@pytest.mark.parametrize("mu", [0.0, 0.3, 3.0])
def test_squeezed_bodies_have_no_solution_and_the_proof_says_so(mu: float) -> None:
    problem = of(wedge(mu, squeeze=0.1))
    with pytest.raises(ConvergenceError, match="no solution"):
        solve(problem)
    proof = solve(problem, keep_unconverged=True).infeasibility
    assert proof is not None
    assert set(proof.contacts) == {0, 1}
    # the proof by hand: opposed normals with equal weights transmit no motion, and q works against them
    z = np.zeros(6)
    z[0::3] = proof.multiplier / proof.multiplier.sum()
    assert np.abs(problem.delassus.T @ z).max() < 1e-9
    assert problem.q @ z < -0.09
    assert check_infeasibility(problem, np.array([1.0, 0.0])) < 1e6
    assert check_infeasibility(problem, np.array([1.0, -1.0])) == 0.0


def test_a_problem_with_solution_is_not_proved_to_have_none() -> None:
    for family in (boxes(5), spheres(0, 3), wedge(0.3)):
        assert find_infeasibility(of(family)) is None


def test_interior_velocities_prove_existence() -> None:
    margin, u = interior_velocity(of(boxes(3)))
    assert margin > 0.1
    assert np.all(u[0::3] > 0.7 * np.hypot(u[1::3], u[2::3]))
    local = of(boxes(3))
    assert interior_velocity(OneStepProblem.local(local.delassus, local.q, local.mu))[0] > 0.1
    assert interior_velocity(of(wedge(0.3, squeeze=0.1)))[0] < 0.0


# --- the linear algebra underneath


@pytest.mark.parametrize("side", [2, 4])
def test_block_systems_are_solved_and_signed_like_dense_ones(side: int) -> None:
    blocks = scaled_blocks(of(spheres(0, side)))
    system, n = BlockSystem(blocks), len(blocks.mu)
    assert system.dense == (side == 2)
    rng = np.random.default_rng(6)
    for _ in range(4):
        value = blocks.value + 0.1 * rng.standard_normal(blocks.value.shape)
        value[blocks.place] += np.eye(3)
        dense = np.zeros((3 * n, 3 * n))
        for i in range(n):
            for k in range(blocks.pointer[i], blocks.pointer[i + 1]):
                j = blocks.column[k]
                dense[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = value[k]
        b = rng.standard_normal((n, 3))
        system.factorise(value)
        assert np.allclose(dense @ system.solve(b).ravel(), b.ravel(), atol=1e-9)
        assert system.sign() == np.linalg.slogdet(dense)[0]


# --- scenes of fenchel


def loaded(material: Material, gravity: float = 0.0) -> tuple[Simulation, float, Drive]:
    radius = np.random.default_rng(100).uniform(0.75e-3, 1.39e-3, 40)
    assembly: Assembly = densify(
        np.random.default_rng(0), radius, wire_count=3, beads=5, spacing=1e-3, bead_radius=0.4e-3, solid_fraction=0.45
    )
    simulation = Simulation(assembly, material, Solver(tolerance=1e-4, sweep_limit=100_000))
    drive = Drive(pressure=np.full(3, 5e4), gravity=np.array([0.0, 0.0, -gravity]))
    step = 0.05 * 2.0 * assembly.grain_radius * np.sqrt(2600.0 / 5e4)
    for _ in range(200):
        simulation.advance(step, drive)
    return simulation, step, drive


@pytest.mark.parametrize(
    "material",
    [
        Material(friction=0.4, normal_stiffness=4e4, tangential_stiffness=3e4),
        Material(friction=0.3, normal_stiffness=4e4, tangential_stiffness=3e4, wire_law="elastic_rod"),
        Material(friction=0.0, bead_friction=0.0, wire_law="rigid_rod"),
    ],
    ids=["compliant", "rods", "frictionless"],
)
def test_the_step_of_a_scene_is_the_problem_that_is_written(material: Material, tmp_path: Path) -> None:
    simulation, step, drive = loaded(material)
    problem = problem_of(simulation, step, drive)
    write_fclib(problem, tmp_path / "step.hdf5")
    read = read_fclib(tmp_path / "step.hdf5")
    assert abs(read.delassus - problem.delassus).max() == 0.0
    assert np.array_equal(read.q, problem.q)
    solution = solve(read, tolerance=1e-10)
    assert judged(problem, solution.r) <= 1e-10
    simulation.solver = Solver(tolerance=1e-12, sweep_limit=200_000)
    simulation.advance(step, drive)
    assert problem.bodies is not None
    v = spsolve(problem.bodies.mass.tocsc(), problem.bodies.f + problem.bodies.h @ solution.r)
    a, n = simulation.assembly, len(simulation.assembly.x)
    size = np.abs(a.velocity).max()
    assert np.allclose(v[: 3 * n].reshape(-1, 3), a.velocity, atol=1e-7 * size)
    if material.friction > 0.0:
        assert np.allclose(v[3 * n : 6 * n].reshape(-1, 3), a.spin, atol=1e-7 * size)


def test_a_rigid_frictional_step_of_a_scene_is_solved() -> None:
    problem = problem_of(*loaded(Material(friction=0.4)))
    solution = solve(problem)
    assert judged(problem, solution.r) <= 1e-8
    assert np.count_nonzero(solution.r[0::3]) > 80


# --- files of other codes


@beside
@pytest.mark.parametrize("name", PEERS)
def test_fclib_files_are_solved_to_1e8_in_both_measures(name: str) -> None:
    problem = read_fclib(FILES / f"{name}.hdf5")
    solution = solve(problem)
    assert judged(problem, solution.r) <= 1e-8
    peer = PEERS[name]
    if peer is not None:
        # work, in counts that no machine changes; times are compared in benchmarks/bench_contact.py
        assert solution.sweeps * problem.delassus.nnz / 9 <= 20e6 * max(2.0 * peer[1], 10e-3)
        assert solution.factorisations <= 60


@beside
@pytest.mark.parametrize(("name", "bound"), [("Box_Stacks-i0122-82-5", 3e-9), ("Capsules-i125-1213", 2e-6)])
def test_the_velocities_are_those_that_the_files_store(name: str, bound: float) -> None:
    """Stored by Siconos (NSGS or ADMM stopped at 1e-8 or after 1000 iterations); the bounds are what our NSGS run of Siconos shows too."""
    stored = stored_velocity(FILES / f"{name}.hdf5")
    assert stored is not None
    u = solve(read_fclib(FILES / f"{name}.hdf5"), tolerance=1e-9).u
    assert np.linalg.norm(u - stored) <= bound * max(np.linalg.norm(stored), 1.0)


@beside
@pytest.mark.validate
@pytest.mark.parametrize(
    ("name", "bound", "limit"),
    [
        ("RockPile_tob1", 1e-7, 60.0),
        ("packing1k_mu05", 4.2e-4, 60.0),
        ("packing1k_mu15", 1e-8, 120.0),
        ("packing1k_massratio1e4", 0.15, 60.0),
    ],
)
def test_the_hard_files(name: str, bound: float, limit: float) -> None:
    problem = read_fclib(FILES / f"{name}.hdf5")
    solution = solve(problem, time_limit=limit, keep_unconverged=True)
    assert solution.errors.natural_map_q <= bound
    assert solution.converged == (solution.errors.worst <= 1e-8)
