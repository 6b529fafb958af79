"""Laboratory files: what is read, what is refused and how it is said, and the command from end to end."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from laboratory_data import LAW, lab_file, lab_text

from fenchel import cli
from fenchel.errors import InputError
from fenchel.identify import identify_laboratory, read_laboratory
from fenchel.identify.laboratory_file import pressure_value
from fenchel.potentials import load_law

ROWS = [(0.0, 0.0, 0.0), *((0.1 * k, 20.0 * k, 0.03 * k) for k in range(1, 12))]


def text(header="eps_a [%],q [kPa],eps_v [%]", head="# confining_pressure = 100 kPa\n", rows=ROWS, mark=","):
    body = "\n".join(mark.join(f"{x:g}" if isinstance(x, float) else x for x in row) for row in rows)
    return f"{head}{header}\n{body}\n"


def read(tmp_path, content, **options):
    path = tmp_path / "lab.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_laboratory(path, **options)


@pytest.mark.parametrize(
    ("header", "factors"),
    [
        ("eps_a [%],q [kPa],eps_v [%]", (1e-2, 1e3, 1e-2)),
        ("Axial strain (%), Deviator stress (kPa), Volumetric strain (%)", (1e-2, 1e3, 1e-2)),
        ("eps_1 [-],deviatoric_stress [MPa],volume strain [1]", (1.0, 1e6, 1.0)),
        ("ε_a [%],q [Pa],ε_v [-]", (1e-2, 1.0, 1.0)),
        ("epsilon_a [mm/mm],sigma_1 - sigma_3 [kN/m²],eps_vol [%]", (1.0, 1e3, 1e-2)),
        ("eps_a [%],q [kPa],Pore water pressure [kPa]", (1e-2, 1e3, 1e3)),
        ("AXIAL_STRAIN [%],Q [KPA],u [Pa]", (1e-2, 1e3, 1.0)),
    ],
)
def test_headers_in_the_words_of_a_laboratory(tmp_path, header, factors):
    rows = [tuple(1e-2 * x for x in row) for row in ROWS]
    test = read(tmp_path, text(header, rows=rows, head="# cell pressure = 0.1 MPa\n"))
    table = np.array(rows) * factors
    assert test.pressure == pytest.approx(1e5)
    assert test.axial_strain == pytest.approx(-table[:, 0])
    assert test.q == pytest.approx(table[:, 1])
    assert test.drained == ("ore" not in header and "u [" not in header)
    assert test.second == pytest.approx(-table[:, 2] if test.drained else table[:, 2])


def test_semicolons_decimal_commas_byte_order_mark_and_comments(tmp_path):
    german = text(mark=";", header="eps_a [%];q [kPa];eps_v [%]").replace(".", ",")
    head = "# sample = clay 7\n# back pressure: 200 kPa\n# confining_pressure [kPa] = 300\n# made on a rainy day\n"
    test = read(tmp_path, b"\xef\xbb\xbf" + (head + german.split("\n", 1)[1]).encode())
    plain = read(tmp_path, text())
    assert np.allclose(test.axial_strain, plain.axial_strain) and np.allclose(test.volume_strain, plain.volume_strain)
    assert (test.name, test.pressure, test.notes) == ("clay 7", pytest.approx(1e5), ("made on a rainy day",))
    assert plain.name == "lab"


def test_strain_and_pore_pressure_count_from_the_first_row(tmp_path):
    rows = [(a + 0.5, q, v + 250.0) for a, q, v in ROWS]
    test = read(tmp_path, text("eps_a [%],q [kPa],u [kPa]", rows=rows, head="# confining_pressure = 350 kPa\n"))
    assert test.axial_strain[0] == 0.0 and test.second[0] == 0.0
    assert test.pressure == pytest.approx(1e5)  # 350 less the 250 of the first row
    assert test.axial_strain[-1] == pytest.approx(-0.011)


def swapped(row, column, cell):
    rows = [tuple(r) for r in ROWS]
    rows[row] = tuple(cell if k == column else x for k, x in enumerate(rows[row]))
    return rows


BAD = {
    "unknown column": (
        text("eps_a [%],q [kPa],wetness [%]"),
        r"row 2: unknown column 'wetness \[%\]'; known are eps_a",
    ),
    "missing unit": (text("eps_a [%],q,eps_v [%]"), r"column 'q' has no unit: write q \[kPa\]"),
    "unknown unit": (text("eps_a [%],q [psi],eps_v [%]"), r"unit \[psi\] is not known here: use Pa, kPa, MPa"),
    "unit of another kind": (text("eps_a [kPa],q [kPa],eps_v [%]"), r"unit \[kPa\] is not known here: use %, - or 1"),
    "column twice": (text("eps_a [%],q [kPa],q [Pa]"), "column q stands twice"),
    "column missing": (text("eps_a [%],u [kPa],eps_v [%]"), "column q .* is missing"),
    "drained and undrained": (
        text("eps_a [%],q [kPa],eps_v [%],u [kPa]", rows=[(*r, 0.0) for r in ROWS]),
        "both eps_v and u are there",
    ),
    "neither": (text("eps_a [%],q [kPa]", rows=[r[:2] for r in ROWS]), "neither eps_v nor u is there"),
    "no pressure": (text(head=""), "does not say its confining pressure: add a line '# confining_pressure = 100 kPa'"),
    "pressure without unit": (text(head="# confining_pressure = 100\n"), "row 1: the pressure 100 has no unit"),
    "pressure is no number": (text(head="# confining_pressure = high\n"), "row 1: 'high' is no pressure"),
    "pressure twice": (
        text(head="# confining_pressure = 100 kPa\n# cell pressure = 1 MPa\n"),
        "row 2: confining_pressure is given twice",
    ),
    "negative pressure": (text(head="# confining_pressure = -5 kPa\n"), "effective pressure must be positive"),
    "back pressure above": (
        text(head="# confining_pressure = 100 kPa\n# back_pressure = 200 kPa\n"),
        "effective pressure must be positive",
    ),
    "back pressure and u": (
        text("eps_a [%],q [kPa],u [kPa]", head="# confining_pressure = 100 kPa\n# back_pressure = 20 kPa\n"),
        "leave back_pressure out",
    ),
    "not a number": (
        text(rows=swapped(4, 1, "12,5x")[:4] + swapped(4, 1, "n.a.")[4:]),
        "row 7, column q: 'n.a.' is not a number",
    ),
    "nan": (text(rows=swapped(3, 2, "nan")), "row 6, column eps_v: nan is not finite"),
    "infinite": (text(rows=swapped(3, 0, "inf")), "row 6, column eps_a: inf is not finite"),
    "empty cell": (text(rows=swapped(5, 1, "")), "row 8, column q: '' is not a number"),
    "short row": (text(rows=[*ROWS[:6], (1.0, 2.0), *ROWS[6:]]), "row 9: 2 cells under 3 columns"),
    "few rows": (text(rows=ROWS[:5]), "5 rows of numbers: a curve needs 8"),
    "empty": ("", "has no header"),
    "only comments": ("# confining_pressure = 100 kPa\n", "has no header"),
    "no text": (b"\xff\xfe\x00\x01", "not UTF-8 text"),
    "no curve": (text(rows=[(0.0, r[1], r[2]) for r in ROWS]), "column eps_a never changes"),
    "per cent as one": (
        text("eps_a [1],q [kPa],eps_v [%]"),
        "eps_a reaches 1.1 .* is the unit in the header the right one",
    ),
    "start under load": (text(rows=ROWS[4:]), "q begins at 80000 Pa"),
    "signs mixed": (text(rows=[(-r[0], r[1], r[2]) for r in ROWS]), "opposite signs"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_breaks_a_rule_is_one_line_and_two_and_writes_nothing(tmp_path, capsys, case):
    content, said = BAD[case]
    with pytest.raises(InputError, match=said):
        read(tmp_path, content)
    code = cli.main(["identify", str(tmp_path / "lab.csv"), "-o", str(tmp_path / "out")])
    out, err = capsys.readouterr()
    assert code == 2
    assert out == "" and err.startswith("fenchel: laboratory file") and err.count("\n") == 1
    assert re.search(said, err)
    assert not (tmp_path / "out").exists()


def test_a_missing_file_and_unknown_signs(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_laboratory(tmp_path / "none.csv")
    with pytest.raises(InputError, match="is unknown: use"):
        read(tmp_path, text(), signs="soil")


@pytest.mark.parametrize("said", ["", "kPa", "1e3 furlong", "nan kPa", "--5 kPa"])
def test_a_pressure_is_a_number_and_a_unit(said):
    with pytest.raises(InputError, match="here: "):
        pressure_value("here", said)


@pytest.fixture
def lab(tmp_path):
    for P in (5e4, 2e5):
        lab_file(tmp_path, f"cd{P / 1e3:g}.csv", LAW, P, step=1e-3)
    lab_file(tmp_path, "cu100.csv", LAW, 1e5, water="undrained", step=1e-3, lines=["# sample = <b>CU"])
    return tmp_path


def run(capsys, folder, *arguments):
    code = cli.main(["identify", *arguments, "-o", str(folder / "out")])
    out, err = capsys.readouterr()
    return code, out, err


def test_from_files_to_a_law_that_drives(lab, capsys):
    paths = [str(lab / "cd50.csv"), str(lab / "cd200.csv")]
    code, out, err = run(capsys, lab, *paths, "--held-out", str(lab / "cu100.csv"), "--quiet", "--json")
    assert (code, err) == (0, "")
    numbers = json.loads(out)
    assert numbers == json.loads((lab / "out" / "report.json").read_text())
    assert numbers["law"] == "sand"
    assert [t["held_out"] for t in numbers["tests"]] == [False, False, True]
    assert numbers["tests"][2]["error_pore_pressure"] < 0.02
    page = (lab / "out" / "report.html").read_text()
    assert page.count("data:image/svg+xml") == 3 and "http" not in page.replace("http-equiv", "")
    assert "&lt;b&gt;CU" in page and "<b>CU" not in page
    for name in ("C_0", "E_s", "H_eff", "not told apart", "Held out", "compression-positive"):
        assert name in page
    assert sorted(f.name for f in (lab / "out").iterdir()) == [
        "law.py", "path_b_CU.csv", "path_cd200.csv", "path_cd50.csv", "report.html", "report.json",
    ]  # fmt: skip
    law, path = f"{lab / 'out' / 'law.py'}:law", str(lab / "out" / "path_b_CU.csv")
    assert cli.main(["drive", law, path, "-o", str(lab / "history.csv")]) == 0


def test_the_pressure_as_an_option_and_the_other_signs(tmp_path, capsys):
    paths = [
        lab_file(tmp_path, f"{k}.csv", LAW, P, step=1e-3, said=False, soil=False) for k, P in enumerate((5e4, 2e5))
    ]
    given = [
        "--confining-pressure",
        "50 kPa",
        "--confining-pressure",
        "0.2 MPa",
        "--signs",
        "tension-positive",
        "--quiet",
    ]
    code, _, err = run(capsys, tmp_path, *map(str, paths), *given)
    assert (code, err) == (0, "")
    numbers = json.loads((tmp_path / "out" / "report.json").read_text())
    assert [t["pressure"] for t in numbers["tests"]] == [5e4, 2e5]
    assert numbers["values"]["E_s"] == pytest.approx(LAW.E_s, rel=0.02)
    code, _, err = run(capsys, tmp_path, str(paths[0]), str(paths[1]), *given[2:])
    assert code == 2 and "1 confining pressures for 2 files" in err


def test_a_law_of_a_file_is_carried_along(lab, capsys):
    declared = lab / "mine.py"
    declared.write_text(
        "from fenchel.potentials import parameter\nfrom fenchel.potentials.library import drucker_prager\n"
        "clay = drucker_prager.with_parameters(name='clay', theta_f=parameter('theta_f', lower=0, upper=1.5, default=0.4))\n"
    )
    starts = ["-p", "E=2e7", "-p", "nu=0.2", "-p", "C_0=5e3", "-p", "H_i=1e6", "--hold", "nu", "--quiet"]
    code, _, err = run(capsys, lab, str(lab / "cd50.csv"), str(lab / "cd200.csv"), "--law", f"{declared}:clay", *starts)
    assert (code, err) == (0, "")
    declared.unlink()
    law = load_law(f"{lab / 'out' / 'law.py'}:law")
    values = {s.name: s.default for s in law.parameters}
    assert values["nu"] == 0.2
    assert values["theta_f"] == pytest.approx(LAW.theta_f, rel=0.1)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["study.toml"], "one study file, or laboratory files"),
        (["--demo"], "one study file, or laboratory files"),
        (["--law", "no_such_law"], "no law is called"),
        (["-p", "G=1"], "no parameter 'G'"),
        (["-p", "nu_s=0.7"], "outside"),
        (["--hold", "G"], "no parameter 'G'"),
        (["--held-out", "none.csv"], "cannot be read"),
        (["--confining-pressure", "100"], "has no unit"),
        (["--scheduler", "tcp://1.2.3.4:1"], "--scheduler is for a study"),
        (["--volume-weight", "nan"], "greater than or equal to 0"),
    ],
)
def test_misuse_is_one_line_and_two_and_writes_nothing(lab, capsys, more, said):
    code, out, err = run(capsys, lab, str(lab / "cd50.csv"), *more)
    assert (code, out) == (2, "")
    assert err.startswith("fenchel: ") and err.count("\n") == 1 and said in err
    assert not (lab / "out").exists()


def test_options_of_a_laboratory_are_not_for_a_study(tmp_path, capsys):
    code, _, err = run(capsys, tmp_path, str(tmp_path / "study.toml"), "--law", "sand")
    assert code == 2 and "--law is for laboratory files" in err


def test_a_law_that_cannot_follow_is_one_line_and_one(lab, capsys):
    code, _, err = run(capsys, lab, str(lab / "cd50.csv"), "--law", "wire", "-p", "lambda_w=1e5", "-p", "mu_w=1e5")
    assert code == 1
    assert err.startswith("fenchel: ") and err.count("\n") == 1
    assert not (lab / "out").exists()


def test_a_folder_that_cannot_be_written_is_said(lab, capsys):
    (lab / "out").write_text("a file")
    code, _, err = run(capsys, lab, str(lab / "cd50.csv"), "--quiet")
    assert code == 1 and "cannot be written" in err


def test_the_report_of_other_tests_is_not_written_over(lab, capsys):
    one, other = str(lab / "cd50.csv"), str(lab / "cd200.csv")
    assert run(capsys, lab, one, "--quiet")[0] == 0
    before = (lab / "out" / "report.json").read_bytes()
    code, _, err = run(capsys, lab, one, other, "--quiet")
    assert code == 2 and err.count("\n") == 1 and "holds the report of cd50: choose another folder" in err
    assert (lab / "out" / "report.json").read_bytes() == before
    assert run(capsys, lab, one, "--hold", "nu_s", "--quiet")[0] == 0  # the same tests, once more
    (lab / "out" / "report.json").write_text("{}")
    code, _, err = run(capsys, lab, one, "--quiet")
    assert code == 2 and "something else" in err


def test_many_rows_are_thinned_for_the_fit_and_samples_may_share_a_name(tmp_path):
    name = ["# sample = S"]
    paths = [
        lab_file(tmp_path, f"{k}.csv", LAW, 1e5, step=2e-5, corners=(0.0, -0.02), lines=name, seed=k) for k in (1, 2)
    ]
    fit = identify_laboratory(paths, tmp_path / "out")
    assert len(fit.replays[0].test.q) == 1001
    assert fit.values["E_s"] == pytest.approx(LAW.E_s, rel=0.02)
    assert {"path_S.csv", "path_S_2.csv"} <= {f.name for f in (tmp_path / "out").iterdir()}


def test_the_files_of_these_tests_say_soil_mechanics_signs():
    rows = lab_text(LAW, 1e5, noise=0.0).splitlines()
    assert rows[0] == "# confining_pressure = 100 kPa" and rows[1] == "eps_a [%], q [kPa], eps_v [%]"
    assert rows[2] == "-0.000,0.0,-0.000" or rows[2].replace("-", "") == "0.000,0.0,0.000"
    assert all(float(cell) > 0 for cell in rows[4].split(","))
