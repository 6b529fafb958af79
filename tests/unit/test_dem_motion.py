"""Scenes of free bodies: the file, its complaints, the run file, resuming, the command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree
from typer.testing import CliRunner

from fenchel.cli import app
from fenchel.dem import chain, hexagonal_floor, lattice
from fenchel.dem.motion import MotionStage, run_motion
from fenchel.dem.motion_scene import bodies_of, read_motion_scene
from fenchel.errors import InputError

SCENE = """
seed = 3

[grains]
count = 24
low = [0.0, 0.0, 0.01]
high = [0.036, 0.036, 0.2]
jitter = 0.05

[floor]
radius = 5e-3
low = [-0.01, -0.01]
high = [0.05, 0.05]

[[plane]]
normal = [1, 0, 0]
point = [0, 0, 0]
friction = 0.3

[[plane]]
normal = [-1, 0, 0]
point = [0.036, 0, 0]
force = 0.5
mass = 0.1

[[chain]]
start = [0.01, 0.02, 0.09]
direction = [1, 0, 0]
beads = 4
spacing = 6e-3
bead_radius = 2e-3
bead_mass = 1e-3

[contact]
law = "signorini_coulomb"
friction = 0.5

[motion]
duration = 0.03
step = 1e-3
least_step = 1e-5
gravity = [0, 0, -9.81]
frames = 3

[solve]
tolerance = 1e-4
"""


class Stop(Exception):
    pass


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return path


def test_a_scene_of_free_bodies_runs_and_resumes_bit_for_bit(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = run_motion(file, tmp_path / "whole.h5")
    assert list(whole["frames"]["time"]) == pytest.approx([0.01, 0.02, 0.03], abs=1.1e-3)
    assert whole["frames"]["x"].shape == (3, len(whole["assembly"]["x"]), 3)
    quality = whole["quality"]
    energy = quality["kinetic"] + quality["elastic"] + quality["friction"] + quality["algorithmic"] + quality["shock"]
    start = 0.5 * float(
        bodies_of(read_motion_scene(file)).mass[:24]
        @ (bodies_of(read_motion_scene(file)).velocity[:24] ** 2).sum(axis=1)
    )
    assert energy + quality["balance"] == pytest.approx(start + quality["external"], rel=1e-9)
    assert whole["kernels"]["bytes"]["pairs"] < 400 and "links" in whole["kernels"]["names"]
    fixed = np.isinf(whole["assembly"]["mass"])
    np.testing.assert_array_equal(whole["frames"]["x"][0][fixed], whole["frames"]["x"][-1][fixed])

    advance = MotionStage.advance

    def limited(stage: MotionStage) -> dict[str, float]:
        if stage.steps >= 15:
            raise Stop
        return advance(stage)

    stopped = tmp_path / "stopped.h5"
    monkeypatch.setattr(MotionStage, "advance", limited)
    with pytest.raises(Stop):
        run_motion(file, stopped, every=0.0)
    monkeypatch.undo()
    again = run_motion(file, stopped, resume=True)
    for name in ("x", "velocity", "kinetic", "natural_map"):
        np.testing.assert_array_equal(whole["frames"][name], again["frames"][name])
    assert whole["quality"] == again["quality"]
    with pytest.raises(InputError, match="exists already"):
        run_motion(file, stopped)


def test_the_command_reports_quality_and_generated_code(file: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["dem", str(file), "-o", str(tmp_path / "run.h5"), "--quiet", "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["frames"] == 3 and told["kernels"]["bytes"]["pairs"] < 400
    assert {name.split("_")[2] for name in told["kernels"]["names"].split()} == {
        "detection",
        "bodies",
        "pairs",
        "planes",
        "links",
        "step",
    }
    text = CliRunner().invoke(app, ["dem", str(file), "-o", str(tmp_path / "run.h5"), "--quiet", "--resume"])
    assert text.exit_code == 0 and "code generated for this scene: " in text.stdout and "pairs (" in text.stdout


def test_disks_and_a_servo_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "flat.toml"
    path.write_text(
        "dimension = 2\n[grains]\ncount = 20\nlow = [0.0, 0.0]\nhigh = [0.06, 0.1]\nrotation = false\n"
        "[[plane]]\nnormal = [0, 1]\npoint = [0, 0]\nfriction = 0.2\n[[plane]]\nnormal = [1, 0]\npoint = [0, 0]\n"
        "[[plane]]\nnormal = [-1, 0]\npoint = [0.06, 0]\npressure = 100.0\narea = 0.1\nmobility = 0.01\nspeed_limit = 0.1\n"
        "[contact]\nlaw = 'compliant_signorini_coulomb'\nnormal_stiffness = 1e5\nfriction = 0.2\n"
        "[motion]\nduration = 0.02\nstep = 1e-3\ngravity = [0, -9.81]\ntheta = 1.0\n"
    )
    content = run_motion(path, tmp_path / "flat.h5")
    assert content["frames"]["x"].shape[2] == 2 and content["assembly"]["spin"].shape[1] == 0
    assert content["quality"]["damping"] > 0.0


BAD = {
    "unknown key": ("friction = 0.3", "fricton = 0.3", ["plane[0]", "fricton", "allowed", "mobility"]),
    "unknown table": ("[floor]", "[flour]", ["flour", "allowed", "floor"]),
    "wrong type": ("count = 24", 'count = "many"', ["grains.count", "int", "str"]),
    "wrong law": ('law = "signorini_coulomb"', 'law = "glue"', ["contact.law", "glue", "newton_restitution"]),
    "plane driven twice": ("force = 0.5", "force = 0.5\nvelocity = [0, 0, 1]", ["plane[1]", "both given"]),
    "plane without mass": ("mass = 0.1", "", ["plane[1]", "mass", "mobility"]),
    "flat vector": ("normal = [1, 0, 0]", "normal = [1, 0]", ["plane[0].normal", "dimension = 3"]),
    "no direction": ("direction = [1, 0, 0]", "direction = [1, 0]", ["chain[0].direction", "3"]),
    "block too small": ("count = 24", "count = 2400", ["region", "do not fit"]),
    "step longer than the run": ("step = 1e-3\nleast", "step = 1.0\nleast", ["motion.step", "motion.duration"]),
    "stiffness of a rigid law": (
        "friction = 0.5",
        "friction = 0.5\nnormal_stiffness = 1e4",
        ["contact.normal_stiffness", "compliant"],
    ),
    "not finite": ("duration = 0.03", "duration = inf", ["motion.duration", "finite"]),
    "not finite inside": ("point = [0, 0, 0]\nfriction", "point = [0, nan, 0]\nfriction", ["plane[0].point", "finite"]),
    "negative mass": (
        "[contact]",
        "[[body]]\nposition = [0, 0, 1]\nradius = 1e-3\nmass = -1.0\n\n[contact]",
        ["body[0].mass", "positive"],
    ),
    "no gravity of three": ("gravity = [0, 0, -9.81]", "gravity = [0, -9.81]", ["motion.gravity", "components"]),
    "floor in the plane": ("seed = 3", "seed = 3\ndimension = 2", ["dimension = 2"]),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_scene_is_one_line_with_the_path_of_the_key(name: str, tmp_path: Path) -> None:
    old, new, words = BAD[name]
    assert old in SCENE
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.replace(old, new, 1))
    with pytest.raises(InputError) as info:
        bodies_of(read_motion_scene(path))
    said = str(info.value)
    assert "\n" not in said
    for word in words:
        assert word in said, said


def test_floors_chains_and_lattices() -> None:
    floor = hexagonal_floor(0.01, (0.0, -0.05), (0.1, 0.05), top=0.02)
    tree = cKDTree(floor)
    near = tree.query(floor, k=7)[0][:, 1:]
    inside = np.all((floor[:, :2] > [0.02, -0.03]) & (floor[:, :2] < [0.08, 0.03]), axis=1)
    # six touching neighbours inside, every point of the rectangle within 2r/sqrt(3) of a bead, all tops at one height
    np.testing.assert_allclose(near[inside], 0.02, rtol=1e-12)
    assert inside.sum() > 5 and np.all(floor[:, 2] + 0.01 == pytest.approx(0.02))
    points = np.random.default_rng(0).uniform([0.0, -0.05], [0.1, 0.05], (500, 2))
    reach = cKDTree(floor[:, :2]).query(points)[0]
    assert reach.max() <= 0.02 / np.sqrt(3.0) + 1e-12
    x, wire, rank = chain(np.array([1.0, 2.0]), np.array([0.0, 3.0]), 4, 0.5, wire=2)
    np.testing.assert_allclose(x, [[1.0, 2.0], [1.0, 2.5], [1.0, 3.0], [1.0, 3.5]])
    assert list(wire) == [2] * 4 and list(rank) == [0, 1, 2, 3]
    places = lattice(7, np.zeros(3), np.array([0.02, 0.02, 0.05]), 0.01)
    assert len(np.unique(places, axis=0)) == 7 and places[:4, 2].max() == pytest.approx(0.005)
    for call in (
        lambda: hexagonal_floor(0.0, (0, 0), (1, 1)),
        lambda: chain(np.zeros(3), np.zeros(3), 3, 1.0),
        lambda: lattice(9, np.zeros(2), np.ones(2), 0.4),
    ):
        with pytest.raises(InputError):
            call()
