"""`fenchel dem` and `fenchel identify` from the outside: exit codes, one line for bad input, nothing lost."""

import errno
import json
import os

import pytest

from fenchel import cli

SCENE = """
[grains]
count = 60
normal_stiffness = 4.3e4
[triaxial]
strain_path = [0.0, -0.0005]
"""


def run(capsys, *arguments):
    code = cli.main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.fixture
def scene(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(SCENE)
    return file


def test_a_scene_runs_and_its_run_is_not_overwritten(capsys, scene, tmp_path):
    run_file = tmp_path / "run.h5"
    code, out, err = run(capsys, "dem", scene, "-o", run_file, "--json", "--quiet")
    assert (code, err) == (0, "")
    assert json.loads(out)["quality"]["natural_map_max"] < 1e-3
    before = run_file.read_bytes()
    code, _, err = run(capsys, "dem", scene, "-o", run_file, "--quiet")
    assert code == 2
    assert err.count("\n") == 1
    assert "--resume" in err
    assert run_file.read_bytes() == before
    code, again, _ = run(capsys, "dem", scene, "-o", run_file, "--resume", "--quiet", "--json")
    assert code == 0
    assert json.loads(again) == json.loads(out)


@pytest.mark.parametrize("command", ["dem", "identify"])
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[grains]\ncolour = 1\n", ("colour", "count")),
        ("[grains]\ncount = 'many'\n", ("grains.count",)),
        ("[grains]\nnormal_stiffness = -1.0\n", ("stiffness",)),
        ("[grains]\nfriction = nan\n", ("grains.friction",)),
        ("[grains\n", ("TOML",)),
    ],
)
def test_a_bad_file_is_one_line_and_writes_nothing(capsys, tmp_path, command, text, words):
    file = tmp_path / "bad.toml"
    file.write_text(text)
    code, out, err = run(capsys, command, file, "-o", tmp_path / "result")
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert all(word in err for word in words), err
    assert list(tmp_path.iterdir()) == [file]


def test_a_truncated_run_is_refused_and_kept(capsys, scene, tmp_path):
    run_file = tmp_path / "run.h5"
    run_file.write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 40)
    before = run_file.read_bytes()
    code, _, err = run(capsys, "dem", scene, "-o", run_file, "--resume", "--quiet")
    assert code == 2
    assert err.count("\n") == 1
    assert run_file.read_bytes() == before


def test_a_full_disk_is_one_line_and_keeps_what_was_there(capsys, tmp_path, monkeypatch):
    path, out_file = tmp_path / "path.csv", tmp_path / "out.csv"
    path.write_text("t,eps_zz\n0,0\n1,1e-4\n")
    out_file.write_text("what was there")

    def full(_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    code, _, err = run(capsys, "drive", "linear_elastic", path, "-p", "E=1e9", "-p", "nu=0.3", "-o", out_file)
    assert code == 1
    assert err.count("\n") == 1
    assert "out.csv" in err
    assert out_file.read_text() == "what was there"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["out.csv", "path.csv"]
