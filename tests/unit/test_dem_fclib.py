"""FCLIB files in every storage order, what is refused, and `fenchel contact` from the outside."""

import json

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from contact_families import boxes, spheres, wedge

from fenchel import cli
from fenchel.dem.one_step import OneStepProblem, read_fclib, solve, write_fclib
from fenchel.errors import ConvergenceError, InputError, Status, StorageError

W = np.array([[2.0, 0.3, 0.0], [0.3, 5.0, 0.0], [0.0, 0.0, 7.0]])


def write_local(path, store, *, q=(-1.0, 0.5, 0.0), mu=(0.5,), spacedim=3):
    with h5py.File(path, "w") as file:
        root = file.create_group("fclib_local")
        root["spacedim"] = np.array([spacedim], dtype=np.int32)
        store(root.create_group("W"))
        root["vectors/q"], root["vectors/mu"] = np.array(q), np.array(mu)


def put(node, m, n, nz, p, i, x, nzmax=None):
    for key, value in (("m", m), ("n", n), ("nz", nz), ("nzmax", len(x) if nzmax is None else nzmax)):
        node[key] = np.array([value], dtype=np.int32)
    node["p"], node["i"], node["x"] = np.array(p, np.int32), np.array(i, np.int32), np.array(x, float)


def rows(node, matrix=W):
    m = sp.csr_matrix(matrix)
    put(node, *m.shape, -2, m.indptr, m.indices, m.data)


def columns(node):
    m = sp.csc_matrix(W)
    put(node, *m.shape, -1, m.indptr, m.indices, m.data)


def triplets(node):
    """Entries beyond nz are junk, one value is given in two parts."""
    m = sp.coo_matrix(W)
    column, row, value = [*m.col, 0, 99], [*m.row, 0, 99], [*m.data, 0.5, np.nan]
    value[0] -= 0.5
    put(node, 3, 3, len(m.data) + 1, column, row, value, nzmax=40)


# an asymmetric matrix tells rows from columns
@pytest.mark.parametrize("store", [rows, columns, triplets])
def test_storage_orders(tmp_path, store, monkeypatch):
    asymmetric = W.copy()
    asymmetric[0, 1] = -0.2
    monkeypatch.setattr(f"{__name__}.W", asymmetric)
    write_local(tmp_path / "a.hdf5", lambda node: store(node) if store is not rows else rows(node, asymmetric))
    problem = read_fclib(tmp_path / "a.hdf5")
    assert np.array_equal(problem.delassus.toarray(), asymmetric)
    assert not problem.symmetric
    assert problem.asymmetry == pytest.approx(np.linalg.norm(asymmetric - asymmetric.T) / np.linalg.norm(asymmetric))


@pytest.mark.parametrize("case", ["local", "global"])
def test_what_is_written_reads_back_and_has_the_same_solution(tmp_path, case):
    g = spheres(1, 3, mu=0.4)
    problem = OneStepProblem.of_bodies(**g)
    if case == "local":
        problem = OneStepProblem.local(problem.delassus, problem.q, problem.mu, title="spheres")
    write_fclib(problem, tmp_path / "p.hdf5", description="written by a test")
    again = read_fclib(tmp_path / "p.hdf5")
    assert (again.bodies is None) == (case == "local")
    assert abs(problem.delassus - again.delassus).max() == 0.0
    assert np.array_equal(problem.q, again.q)
    assert np.array_equal(problem.mu, again.mu)
    assert again.title == problem.title
    assert np.array_equal(solve(problem).u, solve(again).u)
    assert [file.name for file in tmp_path.iterdir()] == ["p.hdf5"]


def test_a_place_that_cannot_be_written_is_one_line(tmp_path):
    with pytest.raises(StorageError, match="not written"):
        write_fclib(OneStepProblem.local(W, [1.0, 0, 0], [0.1]), tmp_path / "no" / "p.hdf5")


def broken(**change):
    def store(node):
        rows(node)
        for key, value in change.items():
            del node[key]
            if value is not None:
                node[key] = value

    return store


@pytest.mark.parametrize(
    ("store", "given", "words"),
    [
        (rows, {"spacedim": 2}, "plane"),
        (rows, {"spacedim": 5}, "rolling"),
        (rows, {"mu": (-0.1,)}, r"mu\[0\]"),
        (rows, {"mu": (np.nan,)}, r"mu\[0\]"),
        (rows, {"mu": (0.1, 0.1)}, "6 x 6"),
        (rows, {"q": (1.0, np.inf, 0.0)}, "finite"),
        (rows, {"q": (1.0, 0.0)}, "3n"),
        (broken(nz=np.array([-7])), {}, "-7"),
        (broken(nz=np.array([100])), {}, "100 triplets"),
        (broken(i=np.array([0, 1, 0, 1, 9], np.int32)), {}, "9"),
        (broken(p=np.array([0, 5, 2, 5], np.int32)), {}, "pointers"),
        (broken(p=np.array([0, 2, 4, 500], np.int32)), {}, "pointers"),
        (broken(m=np.array([10**9])), {}, "1000000000"),
        (broken(x=None), {}, "x is missing"),
        (broken(x=np.array([b"a"] * 5)), {}, "no numbers"),
        (lambda node: rows(node, -W), {}, "semidefinite"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path, store, given, words):
    write_local(tmp_path / "bad.hdf5", store, **given)
    with pytest.raises(InputError, match=words) as refusal:
        read_fclib(tmp_path / "bad.hdf5")
    assert "\n" not in str(refusal.value)
    assert "bad.hdf5" in str(refusal.value)


def test_files_that_are_none(tmp_path, capsys):
    (tmp_path / "text.hdf5").write_text("no")
    with h5py.File(tmp_path / "empty.hdf5", "w"):
        pass
    with h5py.File(tmp_path / "other.hdf5", "w") as file:
        file.create_group("fclib_rolling")
    with h5py.File(tmp_path / "group.hdf5", "w") as file:
        file.create_group("fclib_local/spacedim")
    whole = tmp_path / "cut.hdf5"
    write_fclib(OneStepProblem.local(W, [1.0, 0, 0], [0.1]), whole)
    whole.write_bytes(whole.read_bytes()[:900])
    for name in ("text", "empty", "other", "group", "cut", "absent"):
        assert cli.main(["contact", str(tmp_path / f"{name}.hdf5")]) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1), name
    assert cli.main(["contact", str(tmp_path)]) == 2


def test_a_problem_without_contacts(tmp_path, capsys):
    empty = OneStepProblem.local(np.zeros((0, 0)), np.zeros(0), np.zeros(0))
    write_fclib(empty, tmp_path / "e.hdf5")
    assert solve(read_fclib(tmp_path / "e.hdf5")).converged
    g = wedge(0.3)
    none = OneStepProblem.of_bodies(g["mass"], g["h"][:, :0], g["f"], np.zeros(0), np.zeros(0))
    write_fclib(none, tmp_path / "g.hdf5")
    for name in "eg":
        assert cli.main(["contact", str(tmp_path / f"{name}.hdf5"), "--json", "--certify"]) == 0
        assert json.loads(capsys.readouterr().out)["contacts"] == 0


def test_the_command_reports_and_certifies(tmp_path, capsys):
    write_fclib(OneStepProblem.of_bodies(**boxes(3)), tmp_path / "b.hdf5")
    assert cli.main(["contact", str(tmp_path / "b.hdf5"), "--json", "--certify"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert {"problem", "solver", "converged", "sweeps", "seconds", "errors", "certified"} <= told.keys()
    assert {"natural_map_max", "natural_map_q", "natural_map_scaled", "gap"} <= told["errors"].keys()
    assert told["converged"] is True
    assert told["certified"] is True
    assert told["solver"] == "auto"
    assert max(told["errors"]["natural_map_q"], told["errors"]["natural_map_scaled"]) <= 1e-8
    assert cli.main(["contact", str(tmp_path / "b.hdf5")]) == 0
    assert "natural_map_scaled" in capsys.readouterr().out


def test_the_command_says_what_it_did_not_reach(tmp_path, capsys):
    write_fclib(OneStepProblem.of_bodies(**wedge(0.3, squeeze=0.1)), tmp_path / "s.hdf5")
    assert cli.main(["contact", str(tmp_path / "s.hdf5"), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["converged"] is False
    assert told["status"] == "infeasible"
    assert told["certified"] is None
    assert "no solution" in " ".join(told["notes"])
    write_fclib(OneStepProblem.of_bodies(**spheres(0, 4)), tmp_path / "h.hdf5")
    assert (
        cli.main(
            ["contact", str(tmp_path / "h.hdf5"), "--solver", "nlgs", "--tolerance", "1e-14", "--time-limit", "0.1"]
        )
        == 1
    )
    out = capsys.readouterr().out
    assert "NOT CONVERGED" in out
    assert "time_limit" in out


def test_an_asymmetric_problem_is_solved_as_given_and_the_command_says_so(tmp_path, capsys):
    asymmetric = W.copy()
    asymmetric[0, 1] += 0.1
    write_fclib(OneStepProblem.local(asymmetric, [-1.0, 0.5, 0.0], [0.2]), tmp_path / "a.hdf5")
    assert cli.main(["contact", str(tmp_path / "a.hdf5"), "--json", "--certify"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["symmetric"], told["certified"]) == (False, None)
    assert "as given" in told["notes"][0]


@pytest.mark.parametrize(
    "wrong", [["--solver", "magic"], ["--tolerance", "0"], ["--tolerance", "nan"], ["--time-limit", "-1"]]
)
def test_wrong_options_are_misuse(tmp_path, capsys, wrong):
    write_fclib(OneStepProblem.local(W, [1.0, 0, 0], [0.1]), tmp_path / "p.hdf5")
    assert cli.main(["contact", str(tmp_path / "p.hdf5"), *wrong]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_not_converging_raises_unless_told_otherwise():
    problem = OneStepProblem.of_bodies(**spheres(0, 4))
    with pytest.raises(ConvergenceError, match="natural_map_q"):
        solve(problem, solver="nlgs", tolerance=1e-14, time_limit=0.05)
    kept = solve(problem, solver="nlgs", tolerance=1e-14, time_limit=0.05, keep_unconverged=True)
    assert kept.status is Status.ITERATION_LIMIT


def test_problems_that_are_none():
    with pytest.raises(InputError, match="3n"):
        OneStepProblem.local(np.eye(4), np.zeros(4), [0.1])
    with pytest.raises(InputError, match="finite"):
        OneStepProblem.local(np.diag([1.0, np.nan, 1.0]), np.zeros(3), [0.1])
    with pytest.raises(InputError, match="mass"):
        OneStepProblem.of_bodies(np.diag([1.0, 0.0]), np.ones((2, 3)), np.zeros(2), np.zeros(3), [0.1])
    with pytest.raises(InputError, match="degrees of freedom"):
        OneStepProblem.of_bodies(np.eye(2), np.ones((3, 3)), np.zeros(2), np.zeros(3), [0.1])


def test_a_full_mass_matrix_is_condensed_like_dense_algebra():
    rng = np.random.default_rng(5)
    root = rng.standard_normal((40, 40))
    mass, h, f, w = (
        root @ root.T + np.eye(40),
        rng.standard_normal((40, 9)),
        rng.standard_normal(40),
        rng.standard_normal(9),
    )
    blocks = sp.block_diag([mass[:4, :4], mass[4:7, 4:7], mass[7:40, 7:40]])
    for m in (mass, blocks.toarray(), np.diag(np.diag(mass))):
        problem = OneStepProblem.of_bodies(m, h, f, w, np.zeros(3))
        inverse = np.linalg.inv(m)
        assert np.allclose(problem.delassus.toarray(), h.T @ inverse @ h, rtol=1e-9)
        assert np.allclose(problem.q, w + h.T @ inverse @ f, rtol=1e-9)
