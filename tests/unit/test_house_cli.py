"""The command line as a contract: exit codes, one line for what was foreseen, a start without heavy imports."""

import errno
import json
import subprocess
import sys

import pytest

from fenchel import cli
from fenchel.cli.faults import one_line
from fenchel.cli.values import parameter_values
from fenchel.errors import ConvergenceError, InputError, StorageError

COMMANDS = sorted(command.name for command in cli.app.registered_commands)


def run(capsys, *arguments):
    code = cli.main(list(arguments))
    out, err = capsys.readouterr()
    return code, out, err


def test_the_commands_of_the_contract_are_there():
    assert {"laws", "show", "check", "drive", "dem", "identify", "doctor"} <= set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(capsys, command):
    code, out, _ = run(capsys, command, "--help")
    assert code == 0
    assert f"Example: fenchel {command}" in out


def test_no_command_means_help(capsys):
    code, out, _ = run(capsys)
    assert code == 0
    assert "Usage: fenchel" in out


@pytest.mark.parametrize(
    "arguments",
    [
        ("no-such-command",),
        ("doctor", "--no-such-option"),
        ("dem",),
        ("dem", "scene.toml"),
        ("identify", "-o", "folder"),
        ("identify", "study.toml", "--demo", "-o", "folder"),
    ],
)
def test_misuse_is_one_line_and_two(capsys, arguments):
    code, out, err = run(capsys, *arguments)
    assert code == 2
    assert out == ""
    assert err.startswith("fenchel: ")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("problem", "code"),
    [
        (InputError("scene.toml: grains.count = -1: need 1 or more"), 2),
        (ConvergenceError("step 3 stopped\nabove its tolerance"), 1),
        (StorageError("run.h5: no space left"), 1),
        (OSError(errno.ENOSPC, "No space left on device", "run.h5"), 1),
        (PermissionError(errno.EACCES, "Permission denied", "run.h5"), 1),
        (OSError(errno.EROFS, "Read-only file system", "run.h5"), 1),
        (FileNotFoundError(errno.ENOENT, "No such file or directory", "scene.toml"), 2),
        (MemoryError(), 1),
    ],
)
def test_a_foreseen_failure_is_one_line(problem, code):
    line, exit_code = one_line(problem)
    assert exit_code == code
    assert "\n" not in line
    assert line.startswith("fenchel: ")


def test_a_bug_keeps_its_traceback():
    with pytest.raises(ZeroDivisionError):
        one_line(ZeroDivisionError("division by zero"))


def test_a_missing_file_is_misuse(capsys, tmp_path):
    code, _, err = run(capsys, "dem", str(tmp_path / "none.toml"), "-o", str(tmp_path / "run.h5"))
    assert code == 2
    assert "none.toml" in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_doctor_speaks_json(capsys):
    code, out, _ = run(capsys, "doctor", "--json")
    report = json.loads(out)
    assert code == 0
    assert report["healthy"] is True
    found = {item["name"]: item for item in report["findings"]}
    assert found["compiler (numba)"]["fine"]
    assert found["cone solver (clarabel)"]["fine"]
    assert found["numpy"]["needed"]


def test_doctor_says_what_is_missing(capsys, monkeypatch):
    from fenchel import doctor

    monkeypatch.setattr(doctor, "_NEEDED", ("numpy", "a-package-that-is-not-there"))
    code, out, _ = run(capsys, "doctor", "--json")
    report = json.loads(out)
    assert code == 1
    assert not report["healthy"]
    assert [item["name"] for item in report["findings"] if item["needed"] and not item["fine"]] == [
        "a-package-that-is-not-there"
    ]


def test_the_face_imports_nothing_heavy():
    heavy = ["numpy", "scipy", "sympy", "numba", "cvxpy", "clarabel", "h5py", "matplotlib", "joblib"]
    script = f"import sys, fenchel.cli; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_values_come_from_pairs_before_the_file(tmp_path):
    file = tmp_path / "p.toml"
    file.write_text("E_s = 1e8\nC_0 = 2\n")
    assert parameter_values(["C_0=3.5"], file) == {"E_s": 1e8, "C_0": 3.5}


@pytest.mark.parametrize("pair", ["E_s", "=1", "E_s=soft", "E_s=nan", "E_s=inf"])
def test_a_bad_pair_is_refused(pair):
    with pytest.raises(InputError):
        parameter_values([pair])


@pytest.mark.parametrize("text", ["E_s = ", 'E_s = "a"', "E_s = true", "E_s = nan", "[E_s]\nx = 1"])
def test_a_bad_file_is_refused(tmp_path, text):
    file = tmp_path / "p.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=r"p\.toml"):
        parameter_values([], file)


def test_a_pair_given_twice_is_refused():
    with pytest.raises(InputError, match="twice"):
        parameter_values(["a=1", "a=2"])


def test_check_prints_the_proof_and_its_conditions(capsys):
    code, out, _ = run(capsys, "check", "cam_clay")
    assert code == 0
    assert out.startswith("cam_clay: proved under the conditions:")
    assert "M**2 > 0" in out and "is a norm" in out and "dissipation: phi + phi_star >= 0 follows" in out


def test_check_refutes_with_points_and_exit_one(capsys, tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(
        "from fenchel.potentials import *\n"
        "from sympy import Abs\n"
        "eps, p = sym_tensor('eps'), scalar('p')\n"
        "soft = Law('soft', psi=inner(eps, eps) - p**2, phi_star=indicator(Abs(forces(p)) - 1), observable=eps, internal=(p,))\n"
        "bad = Law('bad', psi=eps, observable=eps) if soft.name == 'bad' else None\n"
    )
    code, out, _ = run(capsys, "check", f"{file}:soft")
    assert code == 1
    assert "soft: refuted" in out and "half way between them" in out
    code, out, _ = run(capsys, "check", f"{file}:soft", "--json")
    found = json.loads(out)
    assert code == 1 and found["admissible"] is False and len(found["counterexample"]["points"]) == 3
    code, out, err = run(capsys, "check", f"{file}:bad")
    assert code == 2 and out == "" and err.count("\n") == 1
    file.write_text("from fenchel.potentials import *\nlaw = Law('a b', psi=1)\n")
    code, out, err = run(capsys, "check", f"{file}:law")
    assert code == 2 and "name begins with a letter" in err


def test_check_decides_the_conditions_by_values(capsys):
    code, out, _ = run(capsys, "check", "sand", "-p", "H_k=-1")
    assert code == 1 and "softening: H_k = -1" in out
    code, out, _ = run(capsys, "check", "sand", "-p", "H_k=1e6", "--json")
    found = json.loads(out)
    assert code == 0 and not any("H_k" in c for c in found["conditions"])
    assert all(row["implied_by_bounds"] for row in found["condition_details"])
    code, _, err = run(capsys, "check", "sand", "-p", "H_x=1")
    assert code == 2 and "no parameter 'H_x'" in err
