"""What goes wrong in the first hour: each mistake is told in one line with its remedy, and what is printed can be read."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fenchel import cli
from fenchel.cli import tables
from fenchel.errors import InputError
from fenchel.integrators import StrainStressPath, drive, read_path, write_history
from fenchel.integrators.path_file import history_columns
from fenchel.potentials import Law, parameters
from fenchel.potentials.library import ENTRIES, LAWS

STEEL = ["-p", "E=2e11", "-p", "nu=0.3", "-p", "sigma_y=2e8", "-p", "H_k=0", "-p", "H_i=1e9"]
PATH = "t,eps_zz\n0,0\n1,0.001\n2,0.002\n"


@pytest.fixture
def path(tmp_path):
    (tmp_path / "path.csv").write_text(PATH)
    return tmp_path / "path.csv"


def refused(capsys, *words):
    """The line on standard error of a command that ends with 2."""
    assert cli.main(list(map(str, words))) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("fenchel: ")
    return err


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("nu=0,3", "write -p nu=0.3"),
        ("E=200GPa", "in SI units without a unit"),
        ("E=200 GPa", "in SI units without a unit"),
        ("E=much", '"much" is not a number'),
    ],
)
def test_a_number_that_is_none(path, capsys, value, said):
    assert said in refused(capsys, "drive", "von_mises", path, "-p", value)


def test_all_missing_parameters_at_once_with_their_units(path, capsys):
    err = refused(capsys, "drive", "von_mises", path, "-p", "E=2e11")
    assert "'H_i' [Pa], 'H_k' [Pa], 'nu' [1], 'sigma_y' [Pa] have no value; give H_i=..." in err


def test_degrees_are_recognised():
    with pytest.raises(
        InputError, match=re.escape("lies outside [0, 1.57] rad; if it is in degrees, 30° = 0.523599 rad")
    ):
        LAWS["sand"].values(ENTRIES["sand"].values | {"theta_f": 30.0})
    with pytest.raises(InputError, match=r"\[0, inf\] Pa; softening is not modelled"):
        LAWS["sand"].values(ENTRIES["sand"].values | {"H_i": -1.0})


def test_parameters_share_bounds_and_unit():
    for symbol in parameters("E_s mu_w", lower=0, unit="Pa"):
        assert (symbol.lower, symbol.upper, symbol.unit) == (0.0, np.inf, "Pa")
    assert parameters("anything").lower == -np.inf


@pytest.mark.parametrize(
    ("law", "said"),
    [
        ("vonmises", "do you mean 'von_mises'?"),
        ("Von-Mises", "do you mean 'von_mises'?"),
        ("clay.py:x", "does not exist"),
    ],
)
def test_a_law_that_is_not_there(path, capsys, law, said):
    assert said in refused(capsys, "drive", law, path)


def test_a_file_without_the_name_of_its_law(tmp_path, path, capsys):
    (tmp_path / "laws.py").write_text("x = 1\n")
    assert "laws.py:NAME" in refused(capsys, "drive", tmp_path / "laws.py", path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t;eps_zz\n0;0\n1;0,001\n", "separated by commas"),
        ("t,eps_zz\n0,0\n1,0,001\n", "numbers have points, not commas"),
        ("t,eps_zz,sig_zz\n0,0,0\n1,0.1,\n", "the same for the whole path"),
    ],
)
def test_a_path_that_is_written_otherwise(tmp_path, capsys, text, said):
    (tmp_path / "path.csv").write_text(text)
    assert said in refused(capsys, "drive", "von_mises", tmp_path / "path.csv", *STEEL)


def test_the_history_does_not_replace_its_path(path, capsys):
    assert "give the history another name" in refused(capsys, "drive", "von_mises", path, *STEEL, "-o", path)
    assert path.read_text() == PATH


@pytest.mark.parametrize("place", ["path.csv/out.csv", "path.csv/deeper/out.csv"])
def test_an_output_that_cannot_be_a_file(path, capsys, place):
    err = refused(capsys, "drive", "von_mises", path, *STEEL, "-o", path.parent / place)
    assert "is not a folder" in err and "space" not in err


def test_strains_in_per_cent_are_doubted(tmp_path, capsys):
    (tmp_path / "path.csv").write_text("t,eps_zz\n0,0\n1,2\n")
    assert cli.main(["drive", "von_mises", str(tmp_path / "path.csv"), *STEEL]) == 0
    err = capsys.readouterr().err
    assert "strains are fractions, not per cent" in err and "200%" in err


@pytest.mark.parametrize("width", [60, 80, 140])
def test_no_number_is_broken_however_narrow_the_terminal(path, capsys, monkeypatch, width):
    monkeypatch.setattr(tables, "_WIDTH_OF_A_FILE", width)
    (path.parent / "triaxial.csv").write_text(
        "t,eps_zz,sig_xx,sig_yy\n0,0,0,0\n1,-0.001,-1e5,-1e5\n2,-0.0127,-1e5,-1e5\n"
    )
    file = path.parent / "out.csv"
    command = ["drive", "von_mises", str(path.parent / "triaxial.csv"), *STEEL]
    assert cli.main([*command, "-o", str(file)]) == 0
    capsys.readouterr()
    assert cli.main(command) == 0
    out = capsys.readouterr().out
    assert all(len(line) <= width for line in out.splitlines())
    words = set(out.split())
    rows = [line.split(",") for line in file.read_text().splitlines()]
    for name in ("sig_zz", "eps_xx", "q", "dissipation"):
        column = rows[0].index(name)
        assert {tables.number(float(row[column])) for row in rows[1:]} <= words, name
    assert not {"-0", "1.45519e-11"} & words


def test_python_reads_and_writes_the_signs_of_the_command_line(tmp_path, capsys):
    (tmp_path / "path.csv").write_text("t,eps_zz,sig_xx,sig_yy\n0,0,0,0\n1,0.001,1e5,1e5\n2,0.002,1e5,1e5\n")
    plan = read_path(tmp_path / "path.csv", signs="compression-positive")
    np.testing.assert_array_equal(plan.targets[:, 2], [0.0, -0.001, -0.002])
    np.testing.assert_array_equal(plan.targets[:, 0], [0.0, -1e5, -1e5])
    values = dict(E=2e11, nu=0.3, sigma_y=2e8, H_k=0.0, H_i=1e9)
    history = drive(LAWS["von_mises"], plan, values)
    write_history(tmp_path / "python.csv", history, plan.time, signs="compression-positive")
    command = ["drive", "von_mises", str(tmp_path / "path.csv"), *STEEL, "--signs", "compression-positive"]
    assert cli.main([*command, "-o", str(tmp_path / "line.csv")]) == 0
    capsys.readouterr()
    assert (tmp_path / "python.csv").read_text() == (tmp_path / "line.csv").read_text()
    with pytest.raises(InputError, match='signs = "soil" is unknown'):
        read_path(tmp_path / "path.csv", signs="soil")
    # a mean pressure is positive in compression under either
    (tmp_path / "p.csv").write_text("t,p,eps_zz\n0,0,0\n1,1e5,0.001\n")
    assert read_path(tmp_path / "p.csv", signs="compression-positive").trace_targets[1] == 1e5
    (tmp_path / "v.csv").write_text("t,eps_v,eps_zz\n0,0,0\n1,1e-3,0.001\n")
    assert read_path(tmp_path / "v.csv", signs="compression-positive").trace_targets[1] == -1e-3


def test_ctrl_c_says_what_is_kept(tmp_path):
    (tmp_path / "scene.toml").write_text(
        "seed = 4\n[grains]\ncount = 3000\nfriction = 0.35\nnormal_stiffness = 4.3e4\n[triaxial]\nstrain_path = [0.0, -2e-1]\n"
    )
    script = (
        "import sys, threading, signal, os, time\n"
        "def press():\n"
        "    while not os.path.exists('run.h5'):\n"
        "        time.sleep(0.1)\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "threading.Thread(target=press, daemon=True).start()\n"
        "from fenchel.cli import main\n"
        "sys.exit(main(['dem', 'scene.toml', '-o', 'run.h5', '--quiet']))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=240)
    assert done.returncode == 128 + signal.SIGINT
    assert (
        done.stdout == ""
        and "the same command with --resume goes on" in done.stderr
        and (tmp_path / "run.h5").exists()
        and done.stderr.count("\n") == 1
    )


def test_ctrl_c_without_arguments(capsys, monkeypatch):
    def pressed(**_):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "app", pressed)
    for words in ([], ["--version"], ["identify", "x.csv"]):
        assert cli.main(words) == 130
        assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("width", [10, 20, 40])
def test_a_number_wider_than_the_terminal_is_whole(capsys, monkeypatch, width):
    monkeypatch.setattr(tables, "_WIDTH_OF_A_FILE", width)
    tables.print_table(("a", "b", "c"), [(1.23456e-100, -2.34567e-100, "words that are folded, many of them")])
    assert {"1.23456e-100", "-2.34567e-100"} <= set(capsys.readouterr().out.split())
    tables.print_table(("only",), [(-1.23456e-100,)])
    tables.print_table(("a", "b"), [])
    assert "-1.23456e-100" in capsys.readouterr().out


def test_brackets_in_heads_and_titles_are_text(capsys):
    tables.print_table(("cost [s per point]", "cost [s]"), [(1.0, 2.0)], title="out/[run].h5 [/x]")
    out = capsys.readouterr().out
    assert "cost [s per point]" in out and "cost [s] " in out and "out/[run].h5 [/x]" in out


def test_figure_and_history_have_names_of_their_own(path, capsys):
    file = path.parent / "out.svg"
    assert "give the figure another name" in refused(
        capsys, "drive", "von_mises", path, *STEEL, "-o", file, "--plot", file
    )
    assert not file.exists()


def test_a_shear_strain_is_told_as_it_was_written(tmp_path, capsys):
    (tmp_path / "path.csv").write_text("t,eps_xy\n0,0\n1,0.4\n")
    assert cli.main(["drive", "von_mises", str(tmp_path / "path.csv"), *STEEL]) == 0
    assert capsys.readouterr().err == ""
    (tmp_path / "path.csv").write_text("t,eps_xy\n0,0\n1,0.6\n")
    assert cli.main(["drive", "von_mises", str(tmp_path / "path.csv"), *STEEL]) == 0
    assert "the strain reaches 0.6, that is 60%" in capsys.readouterr().err


def test_a_scalar_does_not_turn_whatever_its_name(tmp_path):
    history = drive(LAWS["von_mises"], _plan(), dict(E=2e11, nu=0.3, sigma_y=2e8, H_k=0.0, H_i=1e9))
    found = history_columns(replace(history, state={"wear_zz": np.array([0.0, 2.0])}), None, "compression-positive")
    np.testing.assert_array_equal(found["wear_zz"], [0.0, 2.0])
    np.testing.assert_array_equal(found["eps_zz"], [0.0, -1e-3])


def _plan():
    targets = np.zeros((2, 6))
    targets[1, 2] = 1e-3
    return StrainStressPath(np.array([0.0, 1.0]), np.array([True, True, False, True, True, True]), targets)


def test_every_line_of_the_help_is_whole(capsys):
    assert cli.main(["--help"]) == 0
    commands = capsys.readouterr().out.partition("Commands:")[2]
    assert commands.count("\n") > 8 and "..." not in commands


def test_what_takes_long_says_so(capfd, monkeypatch):
    import time

    from fenchel.cli import progress

    monkeypatch.setattr(progress, "_PATIENCE", {False: 0.05})
    with progress.waiting("driving law 'soil'"):
        time.sleep(0.5)
    with progress.waiting("nothing"):
        pass
    time.sleep(0.2)
    err = capfd.readouterr().err
    assert err.count("\n") == 1 and err.startswith("driving law 'soil' ...") and "compiled" in err


def test_a_law_of_a_readme_is_guarded_against_degrees():
    blocks = re.findall(r"```python\n(.*?)```", (Path(__file__).parents[2] / "README.md").read_text(), flags=re.DOTALL)
    space: dict[str, object] = {}
    exec(blocks[0], space)
    soil = space["soil"]
    assert isinstance(soil, Law)
    with pytest.raises(InputError, match=re.escape("30° = 0.523599 rad")):
        soil.values(dict.fromkeys((p.name for p in soil.parameters), 0.1) | {"theta_f": 30.0})
