"""Fronts of scenes, and `accuracy` in a scene: small scenes, errors recomputed from the records of ordinary runs."""

import json
import math

import msgspec
import numpy as np
import pytest
from random_scenes import random_scene

from fenchel.dem import accuracy as chosen
from fenchel.dem import run_scene
from fenchel.dem.accuracy import choose, error_of, features, fit_model, predicted, resolved, with_setting
from fenchel.dem.motion import run_motion
from fenchel.dem.motion_scene import LooseGrains, MotionKeys, MotionScene, PlaneKeys, check_motion_scene
from fenchel.dem.scene import Grains, Scene, SceneSolve, SceneTriaxial, check_scene
from fenchel.dem.slope_scene import SlopeGrains, SlopeKeys, SlopeScene, check_slope_scene
from fenchel.dem.storage import load_run
from fenchel.errors import InputError
from fenchel.front import Front, Measured, keep_front, shipped_front
from fenchel.tradeoff.scene import measure_scene, one_run, settings_of

SMALL = Scene(
    seed=3,
    grains=Grains(count=60, normal_stiffness=4.3e4),
    triaxial=SceneTriaxial(strain_path=(0.0, -0.003), inertial_number=2e-3),
)
FALL = MotionScene(
    motion=MotionKeys(duration=0.02, step=1e-3, gravity=(0.0, 0.0, -9.81), frames=10),
    grains=LooseGrains(count=8, low=(0.0, 0.0, 0.005), high=(0.03, 0.03, 0.03), jitter=0.05),
    plane=(PlaneKeys(normal=(0.0, 0.0, 1.0), point=(0.0, 0.0, 0.0), friction=0.5),),
)
HEAP = SlopeScene(slope=SlopeKeys(rest=1e-3), grains=SlopeGrains(count=30))


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    folder = tmp_path_factory.mktemp("front")
    front = measure_scene(SMALL, folder, steps=(0.05, 0.2), tolerances=(1e-6, 1e-3), jobs=1, show=False)
    return folder, front


def test_every_setting_has_a_figure_and_the_fine_ones_err_less(measured):
    _, front = measured
    errors = {(p.setting["step"], p.setting["tolerance"]): p.error for p in front.points if "law" not in p.setting}
    assert len(errors) == 4 and all(e is not None for e in errors.values())
    assert errors[0.05, 1e-6] < 0.2 * errors[0.05, 1e-3] and errors[0.2, 1e-6] < errors[0.2, 1e-3]
    assert front.points[-1].setting["law"] == "rigid"
    assert all(p.figures["iterations"] > 0 for p in front.points if p.error is not None)


def test_the_error_is_that_of_the_records(measured):
    """Stresses read from the run files and compared here: root mean square along the path over the largest deviator."""
    folder, front = measured
    best, run = (load_run(folder / f"run_{k}.h5")[0] for k in (0, 3))
    x = np.linspace(0.0, min(best["along"][-1], run["along"][-1]), 61)[1:]
    a, b = (np.interp(x, r["along"], r["stress"]) for r in (run, best))
    expected = np.sqrt(np.mean((a - b) ** 2)) / np.abs(b).max()
    assert front.points[1].error == pytest.approx(expected, rel=1e-12)


def test_a_second_call_runs_nothing(measured, monkeypatch):
    folder, front = measured
    monkeypatch.setattr("fenchel.tradeoff.scene.tested", lambda *_: pytest.fail("ran again"))
    again = measure_scene(SMALL, folder, steps=(0.05, 0.2), tolerances=(1e-6, 1e-3), jobs=1, show=False)
    assert again == front


def test_a_failed_setting_says_why_and_others_stand(tmp_path):
    found = one_run("motion", msgspec.to_builtins(FALL), {"step": 1e9, "tolerance": 1e-6}, tmp_path)
    assert found["failure"] == "" or "\n" not in found["failure"]


def test_free_bodies_and_deposits_have_fronts_too(tmp_path):
    front = measure_scene(FALL, tmp_path / "fall", steps=(0.5, 2.0), tolerances=(1e-8, 1e-3), jobs=1, show=False)
    errors = [p.error for p in front.points]
    assert all(e is not None for e in errors) and errors[0] < errors[-1]
    heap = measure_scene(HEAP, tmp_path / "heap", measure="height", tolerances=(1e-3, 1e-2), jobs=1, show=False)
    assert len(heap.points) == 2 and heap.measure.startswith("height")


def test_what_is_not_measured_is_refused(tmp_path):
    with pytest.raises(InputError, match="stress, strain, porosity"):
        measure_scene(SMALL, tmp_path, measure="length", jobs=1, show=False)


def test_settings_try_the_other_contact_law():
    laws = [s["law"] for s in settings_of(SMALL) if "law" in s]
    assert laws == ["rigid"]
    rigid = msgspec.structs.replace(SMALL, grains=Grains(count=60))
    assert [s["law"] for s in settings_of(rigid) if "law" in s] == ["compliant, kappa 1000", "compliant, kappa 10000"]


def test_errors_of_curves_and_numbers():
    along = np.linspace(0.0, 1.0, 101)
    one = {"along": along, "stress": np.sin(along), "angle": 22.0}
    other = {"along": along, "stress": np.sin(along) + 0.01, "angle": 20.0}
    assert error_of("angle", one, other) == pytest.approx(0.1)
    assert error_of("stress", one, other) == pytest.approx(0.01 / (np.sin(1.0) + 0.01), rel=1e-3)


# -- accuracy in a scene -------------------------------------------------------------------------------------------------------


def test_a_scene_runs_with_what_was_chosen_and_goes_on_with_it(tmp_path, monkeypatch):
    scene = check_scene(msgspec.structs.replace(SMALL, accuracy=5e-2))
    record = run_scene(scene, tmp_path / "run.h5")
    said = record.settings["accuracy"]
    setting = said["setting"]
    assert said["accuracy"] == 5e-2 and set(setting) == {"step", "tolerance"} and said["why"]
    assert record.quality["inertial_time_over_step"] == pytest.approx(1.0 / setting["step"])
    # the file remembers: another front does not change a run that has begun
    monkeypatch.setattr(chosen, "choose", lambda *_: pytest.fail("chosen again"))
    again = run_scene(scene, tmp_path / "run.h5", resume=True)
    assert again.settings["accuracy"] == said
    # the same test by hand, with the setting written down: the same numbers, for the preparation does not depend on it
    solve = SceneSolve(tolerance=setting["tolerance"], step=setting["step"], sweep_limit=50_000)
    from fenchel.dem.preparation import make_sample, preparation
    from fenchel.dem.run import triaxial_stage

    sample = make_sample(SMALL.grains, None, SMALL.sample, SMALL.seed)
    for make in preparation(SMALL.grains, None, SMALL.sample, SMALL.solve, 5e4):
        stage = make(sample)
        while not stage.done:
            stage.advance()
    test = triaxial_stage(sample, SMALL.grains, None, SMALL.triaxial, solve, 5e4)
    while not test.done:
        test.advance()
    assert np.array_equal(test.record(seed=3, settings={}).wall_stress, record.wall_stress)


def test_a_kept_front_comes_first(monkeypatch, tmp_path):
    monkeypatch.setenv("FENCHEL_CACHE", str(tmp_path))
    points = (
        Measured(setting={"step": 0.2, "tolerance": 1e-3}, cost=1.0, error=0.2, figures={"residual": 1e-3}),
        Measured(setting={"step": 0.1, "tolerance": 1e-5}, cost=3.0, error=0.01, figures={"residual": 1e-5}),
        Measured(setting={"step": 0.1, "tolerance": 1e-5, "law": "rigid"}, cost=0.1, error=0.001),
    )
    scene = msgspec.structs.replace(SMALL, accuracy=0.02)
    keep_front(Front(kind="scene", subject="x", measure="stress", cost="s", points=points), chosen.scene_key(scene))
    choice = choose(scene)
    assert dict(choice.setting) == {"step": 0.1, "tolerance": 1e-5} and choice.residual == pytest.approx(1e-4)
    assert choice.confirmed(5e-5) is True and choice.confirmed(2e-4) is False
    other_seed = msgspec.structs.replace(scene, seed=99, accuracy=0.3)
    assert choose(other_seed).setting["step"] == 0.2
    with pytest.raises(InputError, match=r"ends at 1\.0e-02"):
        choose(msgspec.structs.replace(scene, accuracy=1e-4))


def test_finer_accuracies_cost_more_and_never_less():
    settings = [dict(choose(msgspec.structs.replace(SMALL, accuracy=a)).setting) for a in (0.2, 0.05, 0.01)]
    assert settings[0]["tolerance"] >= settings[1]["tolerance"] >= settings[2]["tolerance"]


@pytest.mark.parametrize(
    ("scene", "word"),
    [
        (msgspec.structs.replace(SMALL, accuracy=1e-9), "no setting had it"),
        (msgspec.structs.replace(SMALL, accuracy=1e-2, grains=Grains(count=60)), "no tested scene is like"),
        (msgspec.structs.replace(FALL, accuracy=1e-2), "tradeoff dem"),
        (msgspec.structs.replace(HEAP, accuracy=1e-2), "tradeoff dem"),
    ],
)
def test_where_nothing_is_known_it_says_so(scene, word, monkeypatch, tmp_path):
    monkeypatch.setenv("FENCHEL_CACHE", str(tmp_path))
    with pytest.raises(InputError, match=word) as caught:
        choose(scene)
    assert "\n" not in str(caught.value)


def test_accuracy_excludes_what_it_chooses():
    with pytest.raises(InputError, match=r"accuracy chooses solve\.tolerance"):
        check_scene(msgspec.structs.replace(SMALL, accuracy=1e-2, solve=SceneSolve(tolerance=1e-3)))
    for scene, check in ((FALL, check_motion_scene), (HEAP, check_slope_scene)):
        loose = msgspec.structs.replace(scene.solve, tolerance=5e-2)
        with pytest.raises(InputError, match="accuracy chooses"):
            check(msgspec.structs.replace(scene, accuracy=1e-2, solve=loose))


def test_scenes_of_free_bodies_take_a_kept_front(monkeypatch, tmp_path):
    monkeypatch.setenv("FENCHEL_CACHE", str(tmp_path))
    points = (Measured(setting={"step": 2.0, "tolerance": 1e-4}, cost=1.0, error=0.01),)
    scene = msgspec.structs.replace(FALL, accuracy=0.02)
    keep_front(Front(kind="scene", subject="x", measure="centre", cost="s", points=points), chosen.scene_key(scene))
    found, said = resolved(scene, tmp_path / "none.h5")
    assert found.motion.step == 2e-3 and found.solve.tolerance == 1e-4
    assert said["accuracy"]["residual"] is None  # nothing to hold the residual against
    content = run_motion(scene, tmp_path / "run.h5")
    assert content["quality"]["steps"] == pytest.approx(10, abs=1)
    heap = with_setting(HEAP, choose(scene).setting)
    assert heap.solve.tolerance == 1e-4


def test_the_model_predicts_scenes_it_was_not_fitted_to():
    """Every third shipped scene is left out: predicted log errors are off by less than a factor of two for most, and without bias."""
    content = shipped_front("scene")
    seen = dict(content, scenes=[s for k, s in enumerate(content["scenes"]) if k % 3])
    model, off = fit_model(seen), []
    for row in content["scenes"][::3]:
        least = min(e for e in row["errors"] if e is not None)
        for setting, error in zip(content["settings"], row["errors"], strict=True):
            if error is not None and error > 3.0 * least:
                off.append(math.log10(error) - float(chosen._terms(row["features"], setting) @ model.error))
    off = np.array(off)
    assert abs(off.mean()) < 0.15 and np.mean(np.abs(off) < math.log10(2.0)) > 0.6
    assert 0.1 < model.margin < 0.7
    setting, error, _, share, _ = predicted(content, fit_model(content), features(random_scene(5)), 0.05)
    assert error < 0.05 and 0.0 < share <= 1.0 and set(setting) == {"step", "tolerance"}


def test_choices_are_plain_data():
    choice = choose(msgspec.structs.replace(SMALL, accuracy=0.05))
    assert json.loads(json.dumps(choice.as_dict())) == choice.as_dict()


@pytest.mark.validate
def test_recommended_settings_meet_the_accuracy_on_unseen_scenes(tmp_path):
    """30 random scenes (seeds that are not shipped): where any setting has the accuracy, the recommended one has it in 95 %.

    The bar is 0.9 because 95 % of some seventy cases has a standard deviation of 2.6 %.
    """
    met = cases = 0
    tries = shipped_front("scene")["settings"]
    steps = sorted({s["step"] for s in tries})
    tolerances = sorted({s["tolerance"] for s in tries})
    for seed in range(3000, 3030):
        scene = random_scene(seed)
        front = measure_scene(scene, tmp_path / str(seed), steps=steps, tolerances=tolerances, show=False)
        points = {(p.setting["step"], p.setting["tolerance"]): p.error for p in front.points if "law" not in p.setting}
        for accuracy in (1e-1, 3e-2, 1e-2):
            if not any(e is not None and e <= accuracy for e in points.values()):
                continue
            setting = choose(msgspec.structs.replace(scene, accuracy=accuracy)).setting
            error = points[setting["step"], setting["tolerance"]]
            cases += 1
            met += error is not None and error <= accuracy
    print(f"met in {met} of {cases}")
    assert met >= 0.9 * cases
