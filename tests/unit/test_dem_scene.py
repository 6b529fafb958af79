"""Scene and study files: every bad value is one line that names the key, the rule and the remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from fenchel.dem.scene import read_scene
from fenchel.errors import InputError
from fenchel.identify.study import demo_study, read_study

BAD = {
    "unknown key": ("[grains]\nsize = 3\n", ["grains", "size", "allowed", "radius"]),
    "unknown table": ("[wire]\ncount = 3\n", ["wire", "allowed", "wires"]),
    "wrong type": ('[grains]\ncount = "many"\n', ["grains.count", "int", "str"]),
    "negative stiffness": ("[grains]\nnormal_stiffness = -1.0\n", ["grains.normal_stiffness", "positive"]),
    "friction NaN": ("[grains]\nfriction = nan\n", ["grains.friction"]),
    "infinite density": ("[grains]\ndensity = inf\n", ["grains.density", "finite"]),
    "negative friction": ("[grains]\nfriction = -0.1\n", ["grains.friction", ">= 0"]),
    "reversed radii": ("[grains]\nradius = [2e-3, 1e-3]\n", ["grains.radius", "smallest"]),
    "wire longer than fits": ("[wires]\nbeads = 500\n", ["wires", "does not fit"]),
    "unknown law": ('[wires]\nlaw = "rope"\n', ["wires.law", "rope"]),
    "link wider than the box": ("[wires]\nbeads = 2\nspacing = 0.05\n", ["wires.spacing", "does not fit"]),
    "radius of no grain": ("[grains]\nradius = [1e200, 1e200]\n", ["grains.radius", "between"]),
    "almost empty box": ("[sample]\nsolid_fraction = 1e-9\n", ["sample.solid_fraction"]),
    "empty measuring sphere": ("[triaxial]\nsphere = 0.05\n", ["triaxial.sphere", "grains"]),
    "sphere wider than the shortened box": (
        "[triaxial]\nsphere = 0.95\nstrain_path = [0.0, -0.1]\n",
        ["triaxial.sphere", "sticks out"],
    ),
    "path that does not start at zero": (
        "[triaxial]\nstrain_path = [0.1, 0.0]\n",
        ["triaxial.strain_path", "start at 0"],
    ),
    "repeated strain": ("[triaxial]\nstrain_path = [0.0, -0.01, -0.01]\n", ["triaxial.strain_path", "repeats"]),
    "not TOML": ("grains = {", ["TOML"]),
    "tolerance one": ("[solve]\ntolerance = 1.0\n", ["solve.tolerance"]),
}


def complaint(read, path: Path) -> str:
    with pytest.raises(InputError) as info:
        read(path)
    text = str(info.value)
    assert "\n" not in text
    assert info.value.exit_code == 2
    return text


@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("read", [read_scene, read_study])
def test_bad_file_is_one_line_that_names_key_and_rule(tmp_path: Path, name: str, read) -> None:
    text, words = BAD[name]
    file = tmp_path / "file.toml"
    file.write_text(text)
    said = complaint(read, file)
    for word in [str(file), *words]:
        assert word in said, said


def test_a_pressure_of_zero_needs_cohesion(tmp_path: Path) -> None:
    file = tmp_path / "file.toml"
    file.write_text("[triaxial]\npressure = 0.0\n")
    assert "triaxial.pressure" in complaint(read_scene, file)
    file.write_text("[triaxial]\npressures = [5e4, 0.0]\n")
    assert "cohesion" in complaint(read_study, file)


def test_grains_that_would_run_into_one_another_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "file.toml"
    file.write_text("[grains]\nnormal_stiffness = 4.3e4\n[triaxial]\npressure = 1e7\n")
    assert "κ" in complaint(read_scene, file)
    file.write_text("[grains]\nnormal_stiffness = 4.3e4\n[triaxial]\npressures = [5e4, 7e4]\nheld_out = [1e7]\n")
    assert "triaxial.held_out" in complaint(read_study, file)


def test_what_the_identification_cannot_use_is_refused_before_the_runs(tmp_path: Path) -> None:
    file = tmp_path / "file.toml"
    for text, word in {
        "pressures = [5e4]": "two or more",
        "pressures = []": "two or more",
        "strain_path = [0.0, 0.01]": "shorten",
        "strain_path = [0.0, -1e-4]": "window_sand",
        "frame_strain = 1e-2": "frame_strain",
    }.items():
        file.write_text(f"[triaxial]\n{text}\n")
        assert word in complaint(read_study, file)
    for seed in (-1, 2**63):
        file.write_text(f"[solve]\nseeds = [{seed}]\n")
        assert "solve.seeds" in complaint(read_study, file)
        file.write_text(f"seed = {seed}\n")
        assert "seed" in complaint(read_scene, file)


def test_study_rules(tmp_path: Path) -> None:
    file = tmp_path / "file.toml"
    file.write_text("[triaxial]\npressures = [5e4]\nheld_out = [5e4]\n")
    assert "repeat" in complaint(read_study, file)
    file.write_text("[triaxial]\npressures = [5e4, 50000.01]\n")  # one name for two run files
    assert "repeat" in complaint(read_study, file)
    file.write_text("[solve]\nseeds = [1, 1]\n")
    assert "solve.seeds" in complaint(read_study, file)
    assert "cannot be read" in complaint(read_study, tmp_path / "absent.toml")


def test_demo_study_is_within_the_range_of_the_field() -> None:
    study, _ = demo_study()
    assert study.grains.count >= 1000
    assert len(study.pressures) >= 3 and all(5e4 <= p <= 9e4 for p in study.pressures)
    assert study.wires is not None and study.wires.control and study.triaxial.held_out
