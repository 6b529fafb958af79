"""Fronts of laws and `accuracy=` of a law, held against a step written without fenchel."""

from dataclasses import replace

import numpy as np
import pytest
from law_truth import TRUTHS
from random_laws import random_law

from fenchel.errors import ConvergenceError, FenchelError, InputError
from fenchel.front import Front, Measured, keep_front
from fenchel.integrators import drive_arrays
from fenchel.integrators.accuracy import Choice, UncheckedWarning, error_bound, law_key
from fenchel.integrators.general_update import GeneralUpdate
from fenchel.potentials.library import ENTRIES, von_mises
from fenchel.tradeoff.law_path import measure_path
from fenchel.tradeoff.law_step import load_of, measure_step

VALUES = {"E": 2e11, "nu": 0.3, "sigma_y": 3e8, "H_k": 2e9, "H_i": 1e9}


def radial_return(eps, v):
    """σ of von Mises with mixed hardening from the virgin state, by hand."""
    mu, bulk = v["E"] / (2 * (1 + v["nu"])), v["E"] / (3 * (1 - 2 * v["nu"]))
    one = np.array([1.0, 1, 1, 0, 0, 0])
    mean = eps[:, :3].sum(axis=1, keepdims=True)
    s = 2 * mu * (eps - mean / 3 * one)
    size = np.linalg.norm(s, axis=1, keepdims=True)
    q = np.sqrt(1.5) * size
    # Δp (3μ + H_k + H_i) = q − σ_y: the back stress of the library is 2H_k/3 α
    gain = np.maximum(q - v["sigma_y"], 0.0) / (3 * mu + v["H_k"] + v["H_i"])
    return bulk * mean * one + s - 2 * mu * np.sqrt(1.5) * gain * s / np.where(size > 0, size, 1.0)


@pytest.fixture(autouse=True)
def own_cache_of_fronts(monkeypatch):
    """No front of the user's is found, whatever was kept on this machine."""
    monkeypatch.setattr("fenchel.integrators.accuracy.kept_front", lambda *_: None)


@pytest.fixture(scope="module")
def front():
    load = load_of(von_mises, VALUES, points=60, seed=3)
    tries = [
        {"solver": "closed"},
        {"solver": "closed", "precision": "float32"},
        {"solver": "general", "tolerance": 1e-2},
        {"solver": "general"},
        {"solver": "cvxpy", "tolerance": 1e-4},
        {"solver": "principal"},
    ]
    return measure_step(von_mises, VALUES, load=load, settings=tries)


def test_the_hand_written_step_is_the_law():
    eps = 5e-3 * np.random.default_rng(1).normal(size=(50, 6))
    assert TRUTHS["von_mises"] is not None
    assert np.allclose(von_mises.compile()(eps, None, **VALUES).stress, radial_return(eps, VALUES), rtol=0, atol=1e-4)


def test_errors_of_the_front_are_those_of_the_settings(front):
    """The measured error of single precision and of a loose program against the hand-written step, within what points differ by."""
    errors = {p.name: p.error for p in front.points}
    assert errors["solver closed"] < 1e-12
    assert 1e-9 < errors["solver closed, precision float32"] < 1e-6
    assert errors["solver general"] < 1e-11
    assert errors["solver general"] < errors["solver general, tolerance 0.01"]
    assert errors["solver principal"] is None  # it has no principal values to reduce to, and says so
    assert "principal" in next(p.failure for p in front.points if p.setting["solver"] == "principal")


def test_bounds_hold_the_errors(front):
    for point in front.points:
        if point.error is not None:
            assert point.error <= point.figures["bound"] * (1 + 1e-9) + 1e-14


def test_exact_in_closed_form_dominates(front):
    assert front.points[front.efficient[0]].setting["solver"] == "closed"
    assert all(front.points[k].setting["solver"] == "closed" for k in front.efficient)


@pytest.mark.parametrize("size", [0.0, 1e-3, 1e-1])
def test_the_bound_is_never_below_the_error(size):
    """A step made wrong by a known amount: difference + gap bound it from above, and are not idle."""
    rng = np.random.default_rng(5)
    eps = 4e-3 * rng.normal(size=(40, 6))
    update = von_mises.compile()
    out = update(eps, None, **VALUES)
    true = radial_return(eps, VALUES)
    wrong = out.stress * (1.0 + size)
    out.stress[:] = wrong
    bound = error_bound(GeneralUpdate.of(von_mises, False), update, out, None, **VALUES)
    scale = np.sqrt((wrong**2).sum(axis=1)).max()
    error = np.sqrt(((wrong - true) ** 2).sum(axis=1)) / scale
    assert (error <= bound.difference + bound.gap + 1e-15).all()
    assert (bound.difference + bound.gap <= error + 1e-6).all()
    assert bound.confirms(2e-6) == (size == 0.0)


def wanted(law, setting, accuracy=1e-6):
    """A front by which `accuracy=` has to choose a setting."""
    points = (
        Measured(setting=setting, cost=1.0, error=0.5 * accuracy),
        Measured(setting={"solver": law.compile().solver}, cost=9.0, error=1e-15),
    )
    return Front(kind="law", subject=law.name, measure="m", cost="s", points=points)


def test_an_accuracy_takes_the_cheapest_setting_of_the_kept_front(monkeypatch, tmp_path):
    from fenchel.front import kept_front

    monkeypatch.setattr("fenchel.integrators.accuracy.kept_front", kept_front)
    monkeypatch.setenv("FENCHEL_CACHE", str(tmp_path))
    keep_front(wanted(von_mises, {"solver": "general", "tolerance": 1e-8}), law_key(von_mises, "3d"))
    update = von_mises.compile(accuracy=1e-6)
    assert dict(update.choice.setting) == {"solver": "general", "tolerance": 1e-8}
    assert update.solver == "general" and "measured on this machine" in str(update.choice)
    assert von_mises.compile(accuracy=1e-9).solver == "closed"
    with pytest.raises(InputError, match="finest"):
        von_mises.compile(accuracy=1e-13)


def test_shipped_fronts_choose_the_laws_own_method():
    eps = 4e-3 * np.random.default_rng(2).normal(size=(40, 6))
    for name in ("von_mises", "cam_clay", "mohr_coulomb", "kelvin_voigt"):
        entry = ENTRIES[name]
        update = entry.law.compile(accuracy=1e-8)
        assert update.solver == entry.law.compile().solver
        out = update(eps, None, entry.worked.dt, **entry.values)
        plain = entry.law.compile()(eps, None, entry.worked.dt, **entry.values)
        assert np.abs(out.stress - plain.stress).max() <= 1e-8 * np.abs(plain.stress).max()
        assert update.checks == 1 and update.fallbacks == 0 and update.worst <= 1e-8


def test_a_call_may_be_certified_too():
    update = von_mises.compile(accuracy=1e-8)
    out = update(4e-3 * np.ones((3, 6)), None, certify=True, **VALUES)
    assert update.checks == 1 and out.gap is not None and (out.gap >= 0.0).all()


def test_calls_are_checked_ever_more_rarely():
    update = von_mises.compile(accuracy=1e-8)
    for _ in range(20):
        update(1e-3 * np.ones((3, 6)), None, **VALUES)
    assert update.calls == 20 and update.checks == 5  # 1, 2, 4, 8, 16


class Broken:
    """An update that errs by a known relative amount."""

    def __init__(self, update, wrong):
        self.update, self.wrong = update, wrong

    def __getattr__(self, name):
        return getattr(self.update, name)

    def __call__(self, *arguments, **values):
        out = self.update(*arguments, **values)
        out.stress[:] *= 1.0 + self.wrong
        return out


def test_a_wrong_answer_is_seen_and_done_again_exactly():
    update = von_mises.compile(accuracy=1e-5)
    update.inner = Broken(update.exact, 1e-3)
    eps = 4e-3 * np.random.default_rng(2).normal(size=(40, 6))
    out = update(eps, None, **VALUES)
    assert update.fallbacks == 1 and update.inner is update.exact
    assert np.allclose(out.stress, radial_return(eps, VALUES), rtol=0, atol=1e-4)
    assert 5e-4 < update.worst < 1.1e-3  # of the points that were looked at


def test_an_accuracy_that_cannot_be_met_raises():
    update = von_mises.compile(accuracy=1e-5)
    update.inner = update.exact = Broken(von_mises.compile(), 1e-3)
    with pytest.raises(ConvergenceError, match="too ill-conditioned"):
        update(4e-3 * np.ones((4, 6)), None, **VALUES)


@pytest.mark.parametrize("kind", ["plane_strain", "axisymmetric", "plane_stress", "uniaxial"])
@pytest.mark.parametrize("formulation", ["strain", "stress"])
def test_checks_work_in_every_dimension_and_formulation(kind, formulation):
    update = von_mises.compile(kind, formulation=formulation, accuracy=1e-7)
    size = len(update.dimension.given)
    driven = (3e8 if formulation == "stress" else 3e-3) * np.random.default_rng(4).normal(size=(6, size))
    out = update(driven, None, **VALUES)
    again = update(1.2 * driven, out.state, **VALUES)
    assert update.checks == 2 and update.worst < 1e-7
    assert np.isfinite(again.stress).all()


def test_a_path_is_driven_by_a_step_of_an_accuracy():
    path = np.zeros((5, 6))
    path[:, 0] = np.linspace(0, 4e-3, 5)
    control = [False] + [True] * 5
    found = drive_arrays(von_mises.compile(accuracy=1e-8), control, path, VALUES)
    assert np.array_equal(found.sig, drive_arrays(von_mises.compile(), control, path, VALUES).sig)


@pytest.mark.parametrize("name", ["von_mises", "sand", "maxwell", "thermo_elasto_plastic", "mohr_coulomb"])
def test_sampled_rows_of_a_path_are_checked(name):
    entry = ENTRIES[name]
    update = entry.law.compile(accuracy=1e-6)
    path = np.zeros((30, 6))
    path[:, 0] = -np.linspace(0, 3e-3, 30)
    path[:, 5] = 1e-3 * np.sin(np.linspace(0, 6, 30))
    more = {} if entry.law.temperature is None else {"temperatures": np.linspace(290.0, 330.0, 30)}
    found = drive_arrays(update, [False] * 6, path, entry.values, times=np.linspace(0.0, 2.0, 30) ** 2, **more)
    assert update.checks == 1 and update.fallbacks == 0 and update.worst <= 1e-8 and len(update.last.difference) == 8
    assert np.isfinite(found.sig).all()


@pytest.mark.parametrize("wrong", ["sig", "state"])
def test_a_wrong_path_is_seen_and_done_again_exactly(wrong):
    update = von_mises.compile(accuracy=1e-5)
    update.inner = Broken(update.exact, 0.0)
    path = np.zeros((20, 6))
    path[:, 5] = 2e-2 * np.sin(np.linspace(0, 6, 20))  # with rows that unload, of which the stress depends on the past

    def drive(one):
        found = drive_arrays(update.exact, [False] * 6, path, VALUES)
        if one is update.exact:
            return found
        if wrong == "sig":
            return replace(found, sig=1.001 * found.sig)
        # a path that keeps a wrong state: every row after it answers to the wrong past
        return replace(found, state={name: 1.01 * value for name, value in found.state.items()})

    found = update.follow(drive, None, np.ones(20), **VALUES)
    assert update.fallbacks == 1 and update.checks == 2 and update.inner is update.exact
    assert 5e-4 < update.worst < 0.3
    assert np.array_equal(found.sig, drive_arrays(von_mises.compile(), [False] * 6, path, VALUES).sig)
    update.exact = Broken(update.exact, 0.0)
    with pytest.raises(ConvergenceError, match="too ill-conditioned"):
        update.follow(lambda one: replace(found, sig=1.001 * found.sig), None, np.ones(20), **VALUES)


class Silent:
    """A trusted engine that has no answer at some points."""

    def __init__(self, trusted, lost):
        self.trusted, self.lost = trusted, lost

    def __getattr__(self, name):
        return getattr(self.trusted, name)

    def solve(self, *arguments, **options):
        found = self.trusted.solve(*arguments, **options)
        found.status[self.lost] = 1
        found.slopes[self.lost] = np.nan
        return found


def test_points_that_nobody_can_check_are_told():
    eps = 4e-3 * np.random.default_rng(2).normal(size=(6, 6))
    update = von_mises.compile(accuracy=1e-8)
    update.__dict__["_trusted"] = Silent(GeneralUpdate.of(von_mises, False), [1, 4])
    update(eps, None, **VALUES)
    assert update.last.unanswered == 2 and len(update.last.difference) == 4 and update.last.confirms(1e-8)
    update = von_mises.compile(accuracy=1e-8)
    update.__dict__["_trusted"] = Silent(GeneralUpdate.of(von_mises, False), slice(None))
    with pytest.warns(UncheckedWarning, match="not checked"):
        out = update(eps, None, **VALUES)
    assert np.isfinite(out.stress).all() and "no answer at 6 of 6" in update.unchecked
    path = np.outer(np.linspace(0, 1, 5), eps[0])
    with pytest.warns(UncheckedWarning, match="not checked"):
        drive_arrays(update, [False] * 6, path, VALUES)
    with pytest.raises(ConvergenceError, match="no answer"):
        error_bound(Silent(GeneralUpdate.of(von_mises, False), [0]), update, out, None, **VALUES)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"accuracy": 2.0}, "between 0 and 1"),
        ({"accuracy": 1e-6, "solver": "general"}, "leave them out"),
        ({"accuracy": 1e-6, "tolerance": 1e-8}, "leave them out"),
        ({"tolerance": 1e-8}, "no tolerance"),
        ({"tolerance": 2.0, "solver": "general"}, "between 1e-15 and 1"),
        ({"tolerance": float("nan"), "solver": "general"}, "between 1e-15 and 1"),
    ],
)
def test_bad_wishes_are_refused_in_one_line(options, word):
    with pytest.raises(InputError, match=word) as caught:
        von_mises.compile(**options)
    assert "\n" not in str(caught.value)


def test_a_tolerance_reaches_the_method():
    eps = 4e-3 * np.random.default_rng(2).normal(size=(30, 6))
    true = radial_return(eps, VALUES)
    size = np.abs(true).max()
    loose = np.abs(von_mises.compile(solver="cvxpy", tolerance=1e-3)(eps[:3], None, **VALUES).stress - true[:3]).max()
    tight = np.abs(von_mises.compile(solver="cvxpy", tolerance=1e-9)(eps[:3], None, **VALUES).stress - true[:3]).max()
    assert tight < 1e-5 * size and tight < 0.1 * loose
    assert GeneralUpdate.of(von_mises, tolerance=1e-5).tolerance == 1e-5
    assert von_mises.compile(solver="explicit", tolerance=1e-3).tolerance == 1e-3


def test_a_path_in_more_steps_errs_less_at_the_order_of_the_scheme(monkeypatch):
    monkeypatch.setattr("fenchel.tradeoff.law_path.EXPLICIT", (1e-3,))
    entry = ENTRIES["maxwell"]
    front = measure_path(entry.law, entry.values, dt=entry.worked.dt)
    errors = {p.setting["parts"]: p.error for p in front.points if p.setting["solver"] == "auto"}
    ratio = errors[32] / errors[64]
    assert ratio == pytest.approx(2.0, rel=0.1)
    worth = float(front.note.split()[-1])
    assert worth < 0.5 * errors[64]
    explicit = [p.error for p in front.points if p.setting["solver"] == "explicit" and p.error is not None]
    assert explicit and min(explicit) < errors[64]


def test_a_choice_says_why():
    choice = Choice(1e-3, {"solver": "closed"}, 1e-12, "somewhere", "because")
    assert str(choice) == "because"


@pytest.mark.validate
def test_recommended_settings_meet_the_accuracy_on_unseen_laws():
    """200 random laws and states, three accuracies: at least 95 % of the answers are confirmed at every point by the cone program."""
    met = cases = 0
    for seed in range(200):
        drawn = random_law(np.random.default_rng(seed))
        try:
            load = load_of(drawn.law, drawn.values, points=50, seed=seed, dt=drawn.dt, temperature=320.0)
        except FenchelError:
            continue
        for accuracy in (1e-3, 1e-6, 1e-8):
            try:
                update = drawn.law.compile(accuracy=accuracy)
                out = update(load.eps, load.state, load.dt, **load.values)
                bound = update.verify(out, load.state, load.dt, points=50, **load.values)
            except FenchelError as problem:
                print(seed, accuracy, problem)
                cases += 1
                continue
            cases += 1
            met += bound.confirms(accuracy)
    print(f"met in {met} of {cases}")
    assert met >= 0.95 * cases and cases > 500
