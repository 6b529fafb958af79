"""`fenchel laws`, `show`, `check`, `drive` from the outside: what is read, printed and written."""

import csv
import json

import pytest

from fenchel import cli

PARAMETERS = ["-p", "E=2e11", "-p", "nu=0.3", "-p", "sigma_y=3e8", "-p", "H_k=0", "-p", "H_i=1e9"]


def run(capsys, *arguments):
    code = cli.main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.fixture
def path(tmp_path):
    """Uniaxial stress into plastic flow: the axial strain is prescribed, every other stress is zero."""
    file = tmp_path / "path.csv"
    file.write_text("t,eps_zz\n" + "".join(f"{i},{i * 1e-3}\n" for i in range(6)))
    return file


def columns(file):
    with file.open(newline="") as text:
        rows = list(csv.DictReader(text))
    return {name: [float(row[name]) for row in rows] for name in rows[0]}


def test_laws_as_json_have_units(capsys):
    code, out, _ = run(capsys, "laws", "--json")
    laws = json.loads(out)
    assert code == 0
    assert {"sand", "reinforced_sand", "texsol", "von_mises", "drucker_prager", "wire", "linear_elastic"} <= set(laws)
    assert laws["texsol"]["parameters"]["E_s"]["unit"] == "Pa"
    assert all(law["description"] for law in laws.values())


def test_laws_for_people_show_every_law(capsys):
    code, out, _ = run(capsys, "laws")
    assert code == 0
    assert "texsol" in out
    assert "E_s [Pa]" in out


def test_an_unknown_law_lists_those_that_exist(capsys, path):
    code, _, err = run(capsys, "drive", "no_such_law", path)
    assert code == 2
    assert "texsol" in err
    assert err.count("\n") == 1


def test_drive_writes_the_closed_form(capsys, path, tmp_path):
    out_file = tmp_path / "out.csv"
    code, _, _ = run(capsys, "drive", "von_mises", path, *PARAMETERS, "-o", out_file)
    assert code == 0
    got = columns(out_file)
    hardening = 1e9 * 2e11 / (1e9 + 2e11)  # von Mises stress over equivalent plastic strain, in uniaxial tension
    strain = [i * 1e-3 for i in range(6)]
    expected = [min(2e11 * e, 3e8 + hardening * (e - 3e8 / 2e11)) for e in strain]
    assert got["eps_zz"] == pytest.approx(strain)
    assert got["sig_zz"] == pytest.approx(expected, rel=1e-9, abs=1.0)
    assert got["q"] == pytest.approx(expected, rel=1e-9, abs=1.0)
    assert set(got["status"]) == {0.0}


def test_json_holds_the_same_columns(capsys, path, tmp_path):
    out_file = tmp_path / "out.csv"
    code, out, _ = run(capsys, "drive", "von_mises", path, *PARAMETERS, "--json", "--certify", "-o", out_file)
    assert code == 0
    history = json.loads(out)
    assert history == columns(out_file)
    assert max(map(abs, history["gap"])) < 1e-9 * max(history["psi"])


def test_signs_turn_strain_and_stress_but_not_the_pressure(capsys, path, tmp_path):
    tension, compression = tmp_path / "tension.csv", tmp_path / "compression.csv"
    turned = tmp_path / "turned.csv"
    turned.write_text(path.read_text().replace(",", ",-").replace(",-eps", ",eps"))
    assert run(capsys, "drive", "von_mises", path, *PARAMETERS, "-o", tension)[0] == 0
    assert (
        run(capsys, "drive", "von_mises", turned, *PARAMETERS, "--signs", "compression-positive", "-o", compression)[0]
        == 0
    )
    first, second = columns(tension), columns(compression)
    for name, values in first.items():
        sign = -1.0 if name.endswith(("_xx", "_yy", "_zz", "_yz", "_xz", "_xy")) or name == "eps_v" else 1.0
        assert second[name] == pytest.approx([sign * value for value in values], rel=1e-12, abs=1e-9), name
    assert max(first["sig_zz"]) > 1e8


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("-p", "E=2e11"),
        (*PARAMETERS, "-p", "stiffness=1"),
        (*PARAMETERS[:-1], "H_i=-1e9"),
        (*PARAMETERS[:-1], "H_i=nan"),
        (*PARAMETERS, "--parameters", "no-such-file.toml"),
        (*PARAMETERS, "--solver", "magic"),
        (*PARAMETERS, "--signs", "negative"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(capsys, path, tmp_path, arguments):
    out_file = tmp_path / "out.csv"
    code, out, err = run(capsys, "drive", "von_mises", path, *arguments, "-o", out_file)
    assert code == 2
    assert out == ""
    assert err.startswith("fenchel: ")
    assert err.count("\n") == 1
    assert not out_file.exists()


def test_a_law_file_is_driven(capsys, path, tmp_path):
    file = tmp_path / "laws.py"
    file.write_text("from fenchel.potentials.library import von_mises as metal\n")
    code, out, _ = run(capsys, "drive", f"{file}:metal", path, *PARAMETERS)
    assert code == 0
    assert "sig_zz" in out


def test_check_says_what_it_proved(capsys):
    code, out, _ = run(capsys, "check", "von_mises", *PARAMETERS, "--json")
    assert code == 0
    assert json.loads(out)["verdict"] == "proved"


@pytest.mark.parametrize("form", [(), ("--latex",), ("--json",)])
def test_show_prints_table_1(capsys, form):
    code, out, _ = run(capsys, "show", "sand", *form)
    assert code == 0
    assert "sig" in out
    if form == ("--json",):
        json.loads(out)
