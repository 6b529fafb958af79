"""`fenchel compare` and the solvers of `fenchel drive` from the outside: exit codes, tables, JSON."""

import csv
import dataclasses
import json

import pytest

from fenchel import cli

METAL = ["-p", "E=2e11", "-p", "nu=0.3", "-p", "sigma_y=3e8", "-p", "H_k=0", "-p", "H_i=1e9"]
FEW = ["--sampled-rows", "1"]


def run(capsys, *arguments):
    code = cli.main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.fixture
def path(tmp_path):
    """Uniaxial stress into plastic flow."""
    file = tmp_path / "path.csv"
    file.write_text("t,eps_zz\n" + "".join(f"{i},{i * 1e-3}\n" for i in range(5)))
    return file


@pytest.fixture
def strains(tmp_path):
    """All strains prescribed, beyond yield."""
    file = tmp_path / "strains.csv"
    rows = "".join(f"{i},{-3e-4 * i},{-3e-4 * i},{1e-3 * i},0,0,{1e-4 * i}\n" for i in range(5))
    file.write_text("t,eps_xx,eps_yy,eps_zz,eps_yz,eps_xz,eps_xy\n" + rows)
    return file


def test_runs_that_agree_are_a_table_a_verdict_and_zero(capsys, path, tmp_path):
    file = tmp_path / "runs.csv"
    code, out, _ = run(capsys, "compare", "von_mises", path, *METAL, *FEW, "-o", file)
    assert code == 0
    assert "strain closed" in out and "stress general" in out and "strain explicit" in out
    assert "exact: cutting the steps changes nothing but rounding" in out
    last = out.strip().splitlines()[-1]
    assert last.startswith("verdict: all ") and "suits best" in last
    with file.open(newline="") as text:
        rows = list(csv.DictReader(text))
    assert {row["formulation"] for row in rows} == {"strain", "stress"}
    assert all(row["agrees"] == "True" or row["failure"] for row in rows)
    assert max(float(row["stress"]) for row in rows if row["solver"] == "general") <= 1e-8


def test_json_holds_everything_and_signs_change_no_figure(capsys, path, tmp_path):
    turned = tmp_path / "turned.csv"
    turned.write_text(path.read_text().replace(",", ",-").replace(",-eps", ",eps"))
    code, out, _ = run(capsys, "compare", "von_mises", path, *METAL, *FEW, "--json")
    found = json.loads(out)
    assert code == 0
    assert found["agree"] is True and found["order"]["exact"] is True and found["rows"] == 5
    assert found["verdict"]["best"] in ("strain", "stress") and len(found["verdict"]["figures"]) == 2
    assert found["runs"][found["reference"]]["gap"] < 1e-10
    names = {
        "stress",
        "strain",
        "internal",
        "gap",
        "time_per_step",
        "iterations",
        "why",
        "failure",
        "agrees",
        "allowed",
    }
    assert names <= set(found["runs"][0])
    code, out, _ = run(
        capsys, "compare", "von_mises", turned, *METAL, *FEW, "--json", "--signs", "compression-positive"
    )
    assert code == 0
    assert json.loads(out)["scale"] == pytest.approx(found["scale"], rel=1e-12)


def test_runs_that_disagree_are_named_and_one(capsys, path, monkeypatch):
    from fenchel.integrators import comparison_runs

    honest = comparison_runs.follow_path

    def planted(update, given, values):
        history = honest(update, given, values)
        wrong = update.solver == "general" and update.formulation == "strain"
        return dataclasses.replace(history, sig=history.sig * (1.0 + 1e-6)) if wrong else history

    monkeypatch.setattr(comparison_runs, "follow_path", planted)
    code, out, _ = run(capsys, "compare", "von_mises", path, *METAL, *FEW)
    assert code == 1
    assert "NO, above" in out
    assert "1 of " in out.splitlines()[-1] and "disagree (strain general)" in out.splitlines()[-1]


def test_a_path_that_nothing_follows_is_one(capsys, tmp_path):
    file = tmp_path / "path.csv"
    file.write_text("t,sig_zz\n0,0\n1,9e8\n")
    perfect = [*METAL[:-1], "H_i=0"]
    code, out, _ = run(capsys, "compare", "von_mises", file, *perfect, *FEW)
    assert code == 1
    assert "no run follows the path" in out.splitlines()[-1]


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("-p", "E=2e11"),
        (*METAL, "-p", "stiffness=1"),
        (*METAL, "--tolerance", "0"),
        (*METAL, "--sampled-rows", "0"),
        (*METAL, "--signs", "negative"),
        (*METAL[:-1], "H_i=-1e9"),
    ],
)
def test_misuse_is_one_line_and_two(capsys, path, tmp_path, arguments):
    file = tmp_path / "runs.csv"
    code, out, err = run(capsys, "compare", "von_mises", path, *arguments, "-o", file)
    assert (code, out) == (2, "")
    assert err.startswith("fenchel: ") and err.count("\n") == 1
    assert not file.exists()


@pytest.mark.parametrize("solver", ["closed", "general", "conic", "cvxpy", "explicit"])
def test_drive_takes_every_solver_where_all_strains_are_prescribed(capsys, strains, solver):
    code, out, _ = run(capsys, "drive", "von_mises", strains, *METAL, "--solver", solver, "--json")
    assert code == 0
    _, exact, _ = run(capsys, "drive", "von_mises", strains, *METAL, "--json")
    found, exact = json.loads(out), json.loads(exact)
    close = {"cvxpy": 1e-4, "explicit": 1e-4}.get(solver, 1e-9)
    for name in ("sig_zz", "sig_xy", "p", "psi", "dissipation"):
        scale = max(map(abs, exact[name]))
        assert found[name] == pytest.approx(exact[name], rel=close, abs=close * scale), name


def test_drive_says_that_a_solver_without_tangent_needs_all_strains(capsys, path):
    for solver in ("cvxpy", "explicit"):
        code, out, err = run(capsys, "drive", "von_mises", path, *METAL, "--solver", solver)
        assert (code, out) == (2, "")
        assert "prescribe every strain" in err and err.count("\n") == 1


@pytest.mark.parametrize("formulation", ["strain", "stress"])
@pytest.mark.parametrize("solver", ["closed", "general"])
def test_drive_certifies_every_update(capsys, path, solver, formulation):
    options = ("--solver", solver, "--formulation", formulation, "--certify", "--json")
    code, out, _ = run(capsys, "drive", "von_mises", path, *METAL, *options)
    found = json.loads(out)
    assert code == 0
    assert max(map(abs, found["gap"])) < 1e-10 * max(found["psi"])


def test_drive_certifies_a_law_of_which_the_force_of_the_strain_dissipates(capsys, tmp_path):
    file = tmp_path / "path.csv"
    file.write_text("t,eps_zz\n0,0\n0.1,1e-3\n0.3,2e-3\n")
    creep = ["-p", "E=12e6", "-p", "nu=0.2", "-p", "eta=1e6", "-p", "zeta=2e6"]
    code, out, _ = run(capsys, "drive", "kelvin_voigt", file, *creep, "--certify", "--json")
    assert code == 0
    assert max(map(abs, json.loads(out)["gap"])) < 1e-9 * max(json.loads(out)["psi"])


def test_an_explicit_step_has_no_certificate(capsys, strains):
    code, out, err = run(capsys, "drive", "von_mises", strains, *METAL, "--solver", "explicit", "--certify")
    assert (code, out) == (2, "")
    assert "no gap" in err and err.count("\n") == 1
