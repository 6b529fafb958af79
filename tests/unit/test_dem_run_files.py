"""Run files from the outside: killed for good at any instant, out of space for real, units and provenance of every number."""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fenchel.dem import run_scene
from fenchel.dem.scene import Grains, Scene, SceneTriaxial, Wires
from fenchel.dem.storage import UNITS, load_run

SCENE = Scene(
    seed=4,
    grains=Grains(count=60, normal_stiffness=4.3e4),
    wires=Wires(count=4, beads=6),
    triaxial=SceneTriaxial(strain_path=(0.0, -1e-3, 1e-3), inertial_number=2e-3),
)

# the same run in a process of its own, with a checkpoint at nearly every step
RUNNER = """
import sys
from fenchel.dem import run_scene
from fenchel.dem import run
sys.path.insert(0, {folder!r})
from test_dem_run_files import SCENE
from fenchel.errors import FenchelError
print("ready", flush=True)
sys.stdin.readline()
try:
    run_scene(SCENE, {file!r}, resume=True, every=0.0)
except FenchelError as error:
    print(error, file=sys.stderr)
    sys.exit(error.exit_code)
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("whole") / "run.h5"
    run_scene(SCENE, file)
    return file


def start(file: Path, **options: Any) -> subprocess.Popen[str]:
    """A process that waits to be told to run."""
    text = RUNNER.format(folder=str(Path(__file__).parent), file=str(file))
    process = subprocess.Popen(
        [sys.executable, "-c", text],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    return process


def test_a_run_killed_at_any_instant_goes_on_to_the_same_bytes(whole: Path, tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    rng = np.random.default_rng(1)
    stages = []
    for _ in range(2):
        process = start(file)
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
        stamps: set[int] = set()
        while process.poll() is None and len(stamps) < 4:
            if file.exists():
                stamps.add(file.stat().st_mtime_ns)
        time.sleep(float(rng.uniform(0.0, 0.05)))
        process.send_signal(signal.SIGKILL)
        process.communicate()
        if process.returncode == 0:
            break  # the machine was faster
        content, _ = load_run(file)  # whole, whenever it was
        stages.append((int(content["stage"]), int(content["state"].get("steps", 0))))
    assert stages and stages == sorted(stages)  # each went on from where the last one fell
    run_scene(SCENE, file, resume=True)
    assert file.read_bytes() == whole.read_bytes()


def test_a_run_that_finds_no_room_keeps_its_last_checkpoint(whole: Path, tmp_path: Path) -> None:
    """A limit on the size of files in place of a full disk: the system refuses the write, not a stand-in of ours."""
    file = tmp_path / "run.h5"
    from fenchel.dem.preparation import make_sample
    from fenchel.dem.storage import save_run

    a = make_sample(SCENE.grains, SCENE.wires, SCENE.sample, SCENE.seed)
    save_run(tmp_path / "first.h5", {"stage": 0, "state": {}, "assembly": a.arrays()}, {})
    limit = (tmp_path / "first.h5").stat().st_size + 3000  # room for the sample, none for its contacts
    (tmp_path / "first.h5").unlink()
    assert limit < whole.stat().st_size
    process = start(file, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
    _, complaint = process.communicate("\n", timeout=60)
    assert process.returncode == 1 and complaint.count("\n") == 1 and "untouched" in complaint, complaint
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5"]
    content, _ = load_run(file)
    assert "stage" in content and "record" not in content
    run_scene(SCENE, file, resume=True)
    assert file.read_bytes() == whole.read_bytes()


def test_every_number_of_a_run_file_has_a_unit(whole: Path) -> None:
    import h5py

    with h5py.File(whole) as file:
        units = json.loads(file.attrs["units"])
        assert units == UNITS
        checked: list[str] = []

        def check(name: str, item: Any) -> None:
            last = name.rsplit("/", 1)[-1]
            if isinstance(item, h5py.Dataset):
                checked.append(name)
                if item.dtype.kind == "f":
                    assert item.attrs["unit"] == units[last], name
            elif last != "quality":  # dimensionless there but for what is listed; see `QUALITY`
                for key, value in item.attrs.items():
                    assert not isinstance(value, (float, np.floating)) or key in units, f"{name}/{key}"

        file.visititems(check)
    assert len(checked) > 40


def test_a_run_file_says_what_made_it(whole: Path) -> None:
    import h5py
    import numba

    with h5py.File(whole) as file:
        assert json.loads(file.attrs["settings"])["scene"]["grains"]["count"] == 60
        assert json.loads(file.attrs["versions"])["numba"] == numba.__version__
        assert file.attrs["program"].startswith("fenchel ") and len(file.attrs["source"]) == 20
        assert file.attrs["python"] and file.attrs["machine"] and "tension positive" in file.attrs["conventions"]
    _, settings = load_run(whole)
    assert settings["scene"]["seed"] == 4


def test_progress_shows_residual_and_kinetic_energy(tmp_path: Path) -> None:
    seen = []

    def watch(progress: Any) -> None:
        seen.append(progress)
        time.sleep(0.05)

    run_scene(SCENE, tmp_path / "run.h5", progress=watch)
    assert seen and all(0.0 <= p.fraction <= 1.0 and p.residual < 1e-2 and p.kinetic >= 0.0 for p in seen)
    assert [p.fraction for p in seen] == sorted(p.fraction for p in seen)
