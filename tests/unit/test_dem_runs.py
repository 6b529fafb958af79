"""Run files: whole or not at all, and a run that was stopped goes on bit for bit."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from fenchel.dem.run import Progress, load_record, run_scene
from fenchel.dem.scene import Grains, Scene, SceneTriaxial, Wires
from fenchel.dem.storage import load_run, replace_file, save_run
from fenchel.errors import InputError, StorageError

SCENE = Scene(
    seed=4,
    grains=Grains(count=60, normal_stiffness=4.3e4),
    wires=Wires(count=4, beads=6),
    triaxial=SceneTriaxial(strain_path=(0.0, -1e-3, 1e-3), inertial_number=2e-3),
)


class Stop(Exception):
    pass


def test_a_stopped_run_resumes_bit_for_bit(tmp_path: Path) -> None:
    whole = run_scene(SCENE, tmp_path / "whole.h5")
    file = tmp_path / "stopped.h5"
    stopped = 0
    for limit in (0.3, 0.7, 0.95):

        def watch(progress: Progress, limit: float = limit) -> None:
            if progress.fraction > limit:
                raise Stop

        try:
            run_scene(SCENE, file, resume=True, progress=watch, every=0.0)
        except Stop:
            stopped += 1
    again = run_scene(SCENE, file, resume=True)
    assert stopped > 0
    for name in ("axial_strain", "wall_stress", "grain_moment", "link_moment", "grain_fit", "bead_fit"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(again, name))
    assert whole.quality == again.quality
    a, _ = load_run(tmp_path / "whole.h5")
    b, _ = load_run(file)
    for name, value in a["assembly"].items():
        np.testing.assert_array_equal(value, b["assembly"][name])


def test_a_finished_run_is_read_back_and_not_overwritten(tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    record = run_scene(SCENE, file)
    read = load_record(file)
    np.testing.assert_allclose(read.history().stress_links, record.history().stress_links, rtol=1e-14, atol=1e-12)
    np.testing.assert_allclose(read.wall_stress, record.wall_stress, rtol=1e-14)
    with pytest.raises(InputError, match="exists already"):
        run_scene(SCENE, file)
    with pytest.raises(InputError, match="other settings"):
        run_scene(Scene(seed=5), file, resume=True)


def test_truncated_foreign_and_missing_files_are_one_line(tmp_path: Path) -> None:
    good = tmp_path / "good.h5"
    save_run(good, {"a": np.arange(5000.0)}, {})
    data = good.read_bytes()
    for name, content in {"truncated": data[: len(data) // 2], "empty": b"", "text": b"not a run file"}.items():
        file = tmp_path / f"{name}.h5"
        file.write_bytes(content)
        with pytest.raises(InputError, match="unreadable or truncated") as info:
            load_record(file)
        assert "\n" not in str(info.value)
    with pytest.raises(InputError, match="no such run file"):
        load_record(tmp_path / "absent.h5")
    with pytest.raises(InputError, match="not finished"):
        load_record(good)


def test_a_damaged_file_is_refused_and_not_read(tmp_path: Path) -> None:
    """Any changed byte of a number, and settings that are no JSON; a file that HDF5 still opens must not pass for a result."""
    import h5py

    good = tmp_path / "good.h5"
    numbers = np.arange(300.0)
    save_run(good, {"record": {"a": numbers}, "seed": 3}, {"b": 1})
    load_run(good)
    data = good.read_bytes()
    at = data.index(numbers.tobytes()) + 8 * 250
    bad = tmp_path / "bad.h5"
    bad.write_bytes(data[:at] + b"\x17" + data[at + 1 :])
    with pytest.raises(InputError, match="checksum"):
        load_run(bad)
    bad.write_bytes(data)
    with h5py.File(bad, "a") as file:
        file.attrs["settings"] = "{"
    with pytest.raises(InputError, match="checksum"):
        load_run(bad)
    with pytest.raises(InputError, match="incomplete"):
        load_record(good)


def test_a_full_disk_keeps_what_was_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "run.h5"
    replace_file(file, b"before")

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError, match="untouched") as info:
        replace_file(file, b"after")
    assert info.value.exit_code == 1
    assert file.read_bytes() == b"before"
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5"]


def test_a_folder_that_cannot_be_made_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="choose another place"):
        replace_file(tmp_path / "taken" / "run.h5", b"")
