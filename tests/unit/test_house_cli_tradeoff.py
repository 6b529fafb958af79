"""`fenchel tradeoff` from the outside: tables, files, JSON, exit codes."""

import json
import xml.etree.ElementTree as xml

import numpy as np
import pytest
from contact_families import boxes

from fenchel import cli
from fenchel.dem.one_step import OneStepProblem, write_fclib

SCENE = """
seed = 3
[grains]
count = 60
normal_stiffness = 4.3e4
[triaxial]
strain_path = [0.0, -0.002]
inertial_number = 2e-3
"""


def run(capsys, *arguments):
    code = cli.main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.fixture(autouse=True)
def own_fronts(monkeypatch, tmp_path):
    """Fronts are kept beside the test, compiled code where it is."""
    monkeypatch.setattr("fenchel.front._file", lambda kind, key: tmp_path / "kept" / f"{kind}_{key}.json")


def files(folder):
    content = json.loads((folder / "front.json").read_text())
    assert xml.fromstring((folder / "front.svg").read_bytes()).tag.endswith("svg")
    return content


def test_a_law_gets_a_front_of_its_step_and_of_a_path_and_is_remembered(capsys, tmp_path):
    from fenchel.potentials.library import linear_elastic

    folder = tmp_path / "front"
    path = tmp_path / "path.csv"
    path.write_text("t,eps_zz\n" + "".join(f"{i},{i * 1e-3}\n" for i in range(3)))
    words = ("tradeoff", "law", "linear_elastic", path, "-o", folder, "--points", 20, "--accuracy", 1e-6)
    code, out, _ = run(capsys, *words, "--threads", 1, "--quiet")
    assert code == 0
    assert "for 1e-06: solver " in out and "* solver " in out and "1 thread: " in out
    content = files(folder)
    assert [front["kind"] for front in content["fronts"]] == ["law", "path"]
    assert any(point["dominated"] for point in content["fronts"][0]["points"])
    # which one is the cheapest is a matter of the clock, with twenty points all the more
    told = content["recommended"][0]
    point = next(p for p in content["fronts"][0]["points"] if p["setting"] == told["setting"])
    assert told["error"] <= 1e-6 and not point["dominated"]
    assert content["fronts"][0]["environment"]["processor"]
    assert "measured on this machine" in str(linear_elastic.compile(accuracy=1e-6).choice)


def test_a_contact_problem_gets_a_front(capsys, tmp_path):
    file = tmp_path / "tower.hdf5"
    write_fclib(OneStepProblem.of_bodies(**boxes(2)), file)
    folder = tmp_path / "front"
    words = ("tradeoff", "contact", file, "-o", folder, "--solver", "nlgs", "--solver", "auto", "--tolerance", 1e-3)
    code, out, _ = run(capsys, *words, "--accuracy", 1e-2, "--time-limit", 5, "--json", "--quiet")
    assert code == 0
    content = json.loads(out)
    assert content == files(folder)
    points = content["fronts"][0]["points"]
    assert {(p["setting"]["solver"], p["setting"]["start"]) for p in points} == {
        (s, w) for s in ("nlgs", "auto") for w in ("cold", "warm")
    }
    assert content["recommended"][0]["error"] <= 1e-3


def test_a_scene_gets_a_front_and_finished_runs_are_taken_up(capsys, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    folder = tmp_path / "front"
    words = ("tradeoff", "dem", scene, "-o", folder, "--step", 0.1, "--step", 0.2, "--tolerance", 1e-4, "--jobs", 1)
    code, out, _ = run(capsys, *words, "--quiet")
    assert code == 0 and "step 0.1, tolerance 0.0001" in out and "two references differ by" in out
    before = {file: file.stat().st_mtime_ns for file in (folder / "runs").iterdir()}
    assert run(capsys, *words, "--quiet")[0] == 0
    assert before == {file: file.stat().st_mtime_ns for file in (folder / "runs").iterdir()}
    # what was measured is what accuracy finds
    error = min(p["error"] for p in files(folder)["fronts"][0]["points"] if "law" not in p["setting"])
    scene.write_text(f"accuracy = {1.01 * error}\n" + SCENE)
    code, out, _ = run(capsys, "dem", scene, "-o", tmp_path / "run.h5", "--quiet")
    assert code == 0 and "accuracy: " in out and "measured on this machine for this scene" in out
    code, out, _ = run(capsys, "dem", scene, "-o", tmp_path / "run.h5", "--resume", "--json")
    said = json.loads(out)["accuracy"]
    assert said["confirmed"] is True and np.isclose(said["accuracy"], 1.01 * error)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("law", "linear_elastic", "-o", "x", "--accuracy", "2"), "--accuracy 2"),
        (("law", "nothing", "-o", "x"), "nothing"),
        (("law", "linear_elastic", "-o", "x", "--dt", "-1"), "positive"),
        (("contact", "missing.hdf5", "-o", "x"), "missing.hdf5"),
        (("dem", "missing.toml", "-o", "x"), "missing.toml"),
    ],
)
def test_misuse_is_one_line_and_two(capsys, words, line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, err = run(capsys, "tradeoff", *words, "--quiet")
    assert code == 2 and line in err and len(err.strip().splitlines()) == 1
    assert not (tmp_path / "x" / "front.json").exists()


@pytest.mark.parametrize("command", ["law", "contact", "dem"])
def test_help_has_an_example(capsys, command):
    code, out, _ = run(capsys, "tradeoff", command, "--help")
    assert code == 0 and f"Example: fenchel tradeoff {command}" in " ".join(out.split())
