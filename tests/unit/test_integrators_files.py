"""Path files in, history files out."""

import csv

import numpy as np
import pytest

from fenchel.errors import ConvergenceError, InputError
from fenchel.integrators import drive, drive_arrays, read_path, write_history
from fenchel.potentials.library import drucker_prager, sand

SAND = dict(E_s=12e6, nu_s=0.2, theta_f=0.079, C_0=2842.0, H_k=944e3, H_i=472e3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("t,eps_zz\n", "no row"),
        ("t,eps_qq\n0,0\n", "row 1: unknown column 'eps_qq'"),
        ("eps_zz\n0\n", "column 't' is missing"),
        ("t,eps_zz,eps_zz\n0,0,0\n", "stands twice"),
        ("t,eps_zz,sig_zz\n0,0,0\n", "both 'eps_zz' and 'sig_zz'"),
        ("t,eps_zz\n0,0\n1,abc\n", "row 3, column 'eps_zz': 'abc' is not a number"),
        ("t,eps_zz\n0,0\n1,nan\n", "row 3, column 'eps_zz': nan is not finite"),
        ("t,eps_zz\n0,1e-3\n", "row 2, column 'eps_zz'.*must be zero"),
        ("t,eps_zz\n0,0\n1,0,3\n", "row 3: 3 cells under 2 columns"),
        ("t,eps_zz\n0,0\n0,1\n", "row 3, column 't': the time must increase"),
        ("t,eps_v,p\n0,0,0\n", "both 'eps_v' and 'p'"),
        ("t,eps_xx,eps_yy,eps_zz,eps_v\n0,0,0,0,0\n", "replaces a normal component"),
        ("t,T\n0,-3\n", "in kelvin"),
    ],
)
def test_wrong_path_files_are_refused_in_one_line(tmp_path, text, words):
    file = tmp_path / "path.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        read_path(file)
    assert "\n" not in str(caught.value) and "path.csv" in str(caught.value)


def test_an_unreadable_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_path(tmp_path / "absent.csv")


def test_columns_of_a_history(tmp_path):
    file = tmp_path / "path.csv"
    file.write_text("t,eps_zz,eps_xy,sig_xx,sig_yy\n0,0,0,0,0\n1,0,0,-5e4,-5e4\n2,-1e-3,2e-3,-5e4,-5e4\n")
    path = read_path(file)
    history = drive(sand, path, SAND)
    out = tmp_path / "out.csv"
    write_history(out, history, path.time)
    rows = list(csv.DictReader(out.open()))
    parts = ("xx", "yy", "zz", "yz", "xz", "xy")
    wanted = ["t", *(f"eps_{c}" for c in parts), *(f"sig_{c}" for c in parts), "eps_v", "p", "q"]
    wanted += [f"{n}_{c}" for n in ("eps_p", "alpha") for c in parts] + ["internal_p", "psi", "dissipation", "status"]
    assert list(rows[0]) == wanted
    last = {k: float(v) for k, v in rows[-1].items()}
    assert last["eps_xy"] == pytest.approx(2e-3, rel=1e-14)  # plain component, not doubled, not Mandel
    assert last["sig_xx"] == pytest.approx(-5e4, rel=1e-11)
    assert last["p"] == pytest.approx(-(last["sig_xx"] + last["sig_yy"] + last["sig_zz"]) / 3, rel=1e-12)
    assert last["eps_v"] == pytest.approx(last["eps_xx"] + last["eps_yy"] + last["eps_zz"], rel=1e-12)
    assert last["dissipation"] == pytest.approx(2842.0 * last["internal_p"], rel=1e-9)


def test_columns_of_a_huge_stress_stay_finite():
    from fenchel.integrators.path_file import history_columns

    history = drive_arrays(sand.compile(), [False] * 6, [[1e200, 0, 0, 0, 0, 0]], SAND)
    with np.errstate(all="raise"):
        columns = history_columns(history)
    assert np.isfinite(columns["q"]).all() and columns["q"][0] > 1e150


def test_a_stress_that_cannot_be_carried_names_the_row():
    update = drucker_prager.compile()
    values = dict(E=12e6, nu=0.2, theta_f=0.0, C_0=1000.0, H_i=0.0)
    targets = np.zeros((3, 6))
    targets[:, 2] = [-1000.0, -1700.0, -1800.0]  # uniaxial limit sqrt(3) C_0 = 1732
    with pytest.raises(ConvergenceError, match="row 2"):
        drive_arrays(update, [True] * 6, targets, values)


def test_wrong_arrays_are_refused():
    update = sand.compile()
    with pytest.raises(InputError, match="shape"):
        drive_arrays(update, [True] * 5, np.zeros((1, 6)), SAND)
    with pytest.raises(InputError, match="initial_strain"):
        drive_arrays(update, [True] * 6, [[0.0] * 6], SAND, initial_strain=[np.nan] * 6)
    with pytest.raises(InputError, match="row 1"):
        drive_arrays(update, [True] * 6, [[0.0] * 6, [np.nan] * 6], SAND)
    with pytest.raises(InputError, match="shape"):
        update(np.zeros((2, 5)), None, **SAND)
    with pytest.raises(InputError, match="point 1"):
        update([[0.0] * 6, [np.nan] * 6], None, **SAND)
    with pytest.raises(InputError, match="lacks the internal variable"):
        update(np.zeros(6), {"p": 0.0}, **SAND)
    with pytest.raises(InputError, match="no internal variable"):
        update(np.zeros(6), {"q": 0.0}, **SAND)
    with pytest.raises(InputError, match="time step"):
        update(np.zeros(6), None, dt=0.0, **SAND)
    with pytest.raises(InputError, match="solver"):
        sand.compile(solver="magic")
