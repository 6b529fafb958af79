"""The identification of a law from tests on one or several samples: values, intervals, predictions, control, findings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from ..dem.record import PhaseHistory, TriaxialRecord
from ..drawing import Signs, shown
from ..errors import ConvergenceError, InputError
from ..notebook import Summary
from .curves import Curves, curves
from .estimate_view import HEADS as ESTIMATE_HEADS
from .estimate_view import estimate_figure, estimate_rows
from .findings import findings
from .fit import UNITS, LawFit, fit_law, scalars
from .interval import Estimate, estimate
from .jsonable import jsonable
from .mismatch import Mismatch, phase_mismatch
from .options import IdentifyOptions, Specimen
from .parameters import LawParameters
from .prediction import Prediction, predict
from .replay import Simulate, replay

__all__ = ["Control", "Identification", "identify_law"]

OCTANTS = 8
ENTANGLED = "friction, cohesion and hardening not separable"
REPLICA_FRAMES = 100  # per test: a coarser path shifts all octant replicas alike, not their spread


LAW_NAMES = ("E_s", "E_w", "nu", "theta_f", "C_0", "H_eff", "H_k", "H_i")


@dataclass(frozen=True, kw_only=True)
class Control:
    """The same beads unlinked: its own identification, and what the links change (linked − control, paired by sample)."""

    fit: LawFit
    estimates: dict[str, Estimate]
    difference: dict[str, Estimate]
    wire_stress_max: float  # largest component of the link stress in the control [Pa]: zero, or something is wrong


@dataclass(frozen=True, kw_only=True, repr=False)
class Identification(Summary):
    """What `identify_law` found; `law` is the exported set (joint fit over all samples and fitted pressures)."""

    options: IdentifyOptions
    seeds: tuple[int, ...]
    fitted: tuple[float, ...]
    held_out: tuple[float, ...]
    law: LawParameters
    pooled: LawFit
    by_seed: tuple[LawFit, ...]
    estimates: dict[str, Estimate]
    control: Control | None
    predictions: tuple[Prediction, ...]
    mismatches: tuple[Mismatch, ...]
    findings: tuple[str, ...]  # one sentence each, the plainest first
    failed_replicas: int  # octant replicas whose fit did not converge (left out of the spread)
    seconds: float

    HEADS: ClassVar[tuple[str, ...]] = ESTIMATE_HEADS

    def plot(self, *, signs: str = "tension-positive") -> Any:
        """A matplotlib figure: every test and the law that was identified. `InputError` for other `signs` than "tension-positive" and
        "compression-positive"."""
        from .figure_tests import fit_figure

        return shown(fit_figure(self, Signs(signs)))

    def plot_yield(self) -> Any:
        """A matplotlib figure: √J₂ of the sand against its mean pressure, yield points and the fitted lines."""
        from .figure_numbers import yield_figure

        return shown(yield_figure(self))

    def plot_intervals(self) -> Any:
        """A matplotlib figure: the values with the intervals in which another sample is expected, each over its value."""
        return shown(estimate_figure(self.law_estimates))

    def _title(self) -> str:
        levels = ", ".join(f"{level / 1e3:g}" for level in self.fitted)
        return f"a law identified from {len(self.seeds)} sample(s) at {levels} kPa"

    def _rows(self) -> list[tuple[str, ...]]:
        return estimate_rows(self.law_estimates)

    @property
    def law_estimates(self) -> dict[str, Estimate]:
        """The estimates of the parameters of the law, with H_eff = H_k (½ + tan² θ_f/3) + H_i; `estimates` also has what led to them."""
        return {name: self.estimates[name] for name in LAW_NAMES if name in self.estimates}

    def to_json(self) -> dict[str, Any]:
        """Plain numbers, strings, lists and dicts; arrays over frames are left out, nan becomes None."""
        return jsonable(self)


def _tests(source: Any, pressures: Sequence[float], split: str, octant: int | None) -> list[Curves] | None:
    """Curves of the tests of one sample at some pressures, one octant left out if asked; None where that cannot be."""
    out = []
    for level in pressures:
        if level not in source:
            continue
        test = source[level]
        if isinstance(test, TriaxialRecord):
            weights = np.ones(OCTANTS)
            if octant is not None:
                weights[octant] = 0.0
            out.append(curves(test.history(weights), split))
        elif isinstance(test, PhaseHistory):
            if octant is not None:
                return None
            out.append(curves(test, split))
        else:
            raise InputError(
                f"a test at {level:g} Pa is a {type(test).__name__}: give a TriaxialRecord or a PhaseHistory"
            )
    return out


def _replicas(
    source: Any, fitted: Sequence[float], options: IdentifyOptions, simulate: Simulate, start: LawFit, hardening: bool
) -> tuple[list[dict[str, float]], int]:
    """Scalars with each octant left out in turn ({} where a fit failed, so that pairs stay pairs), and the count of
    failures."""
    out: list[dict[str, float]] = []
    failed = 0
    if not options.jackknife:
        return out, failed
    coarse = replace(options, fit_frames=min(options.fit_frames, REPLICA_FRAMES))
    for octant in range(OCTANTS):
        tests = _tests(source, fitted, options.split, octant)
        if tests is None:
            return [], 0
        try:
            out.append(scalars(fit_law(tests, coarse, simulate, start=start, hardening=hardening)))
        except (ConvergenceError, InputError):
            out.append({})
            failed += 1
    return out, failed


def _estimates(
    pooled: dict[str, float],
    seeds: Sequence[dict[str, float]],
    replicas: Sequence[Sequence[dict[str, float]]],
    options: IdentifyOptions,
    notes: dict[str, str],
    lower: float | None = 0.0,
) -> dict[str, Estimate]:
    nan = float("nan")
    out = {
        name: estimate(
            name,
            UNITS[name.split("@")[0]],
            value,
            [s.get(name, nan) for s in seeds],
            [[r.get(name, nan) for r in seed] for seed in replicas],
            confidence=options.confidence,
            lower=None if name.startswith(("q@", "C_0_own", "C_0_study", "theta_f_own", "theta_f_study")) else lower,
            note=notes.get(name, ""),
        )
        for name, value in pooled.items()
    }
    # one of them held at its bound in every replica would leave the others a narrow interval around a wrong value
    return {name: replace(e, low=nan, high=nan, source="none") if e.note == ENTANGLED else e for name, e in out.items()}


def _notes(fit: LawFit) -> dict[str, str]:
    """What must be said beside a value: at a bound, not separable."""
    notes: dict[str, str] = {}
    if fit.elastic.nu_at_bound:
        notes["nu"] = "at its bound"
    for name, value, misfit in (
        ("E_w", fit.elastic.E_w, fit.elastic.misfit_wire),
        ("E_w_bilateral", fit.elastic.E_w_bilateral, fit.elastic.misfit_wire_bilateral),
    ):
        if value == 0.0:
            notes[name] = "at its lower bound" if misfit > 0.0 else "no wire stress"
    for name in fit.yielding.at_bound:
        notes[f"{name}_staged"] = "at its lower bound"
    if fit.hardening is not None:
        for suffix, stage in (("_staged", fit.hardening.staged), ("", fit.hardening.joint)):
            for name in stage.at_bound:
                notes[f"{name}{suffix}"] = "at its lower bound"
            if not fit.hardening.yield_separable:
                notes |= {f"{name}{suffix}": ENTANGLED for name in ("theta_f", "C_0", "H_eff", "H_k", "H_i")}
            if not stage.separable:
                notes[f"H_k{suffix}"] = notes[f"H_i{suffix}"] = "not separable"
    line = fit.yielding.study_least_absolute
    if line is not None and not line.unique:
        notes["theta_f_study"] = notes["C_0_study"] = "least absolute deviations not unique"
    return notes


def _difference(a: dict[str, float], b: dict[str, float]) -> dict[str, float]:
    skip = ("E_w", "E_w_bilateral")
    return {k: a[k] - b[k] for k in a if k in b and k.split("@")[0] not in skip and not k.endswith(("_own", "_study"))}


def _control(
    specimens: Sequence[Specimen],
    linked: tuple[dict[str, float], list[dict[str, float]], list[list[dict[str, float]]]],
    fitted: Sequence[float],
    options: IdentifyOptions,
    simulate: Simulate,
) -> tuple[Control, int]:
    """Identify the controls and subtract, sample by sample and octant by octant."""
    pooled_linked, seeds_linked, replicas_linked = linked
    paired = [k for k, s in enumerate(specimens) if all(level in s.control for level in fitted)]
    tests = [_tests(specimens[k].control, fitted, options.split, None) or [] for k in paired]
    pooled = fit_law([t for group in tests for t in group], options, simulate)
    seeds, replicas, failed = [], [], 0
    for k, group in zip(paired, tests, strict=True):
        own = fit_law(group, options, simulate, start=pooled)
        seeds.append(scalars(own))
        out, lost = _replicas(specimens[k].control, fitted, options, simulate, own, False)
        replicas.append(out)
        failed += lost
    values = scalars(pooled)
    if len(paired) < len(specimens):  # subtract like from like
        pooled_linked = {
            n: float(np.mean([seeds_linked[k].get(n, float("nan")) for k in paired])) for n in pooled_linked
        }
    difference = _estimates(
        _difference(pooled_linked, values),
        [_difference(seeds_linked[k], own) for k, own in zip(paired, seeds, strict=True)],
        [
            [_difference(a, b) for a, b in zip(replicas_linked[k], own, strict=False)]
            for k, own in zip(paired, replicas, strict=True)
        ],
        options,
        {},
        lower=None,
    )
    stress = max(
        float(np.max(np.abs((h.history() if isinstance(h, TriaxialRecord) else h).stress_links)))
        for s in specimens
        for h in s.control.values()
    )
    control = Control(
        fit=pooled,
        estimates=_estimates(values, seeds, replicas, options, _notes(pooled)),
        difference=difference,
        wire_stress_max=stress,
    )
    return control, failed


def identify_law(
    specimens: Sequence[Specimen],
    options: IdentifyOptions | None = None,
    *,
    simulate: Simulate = replay,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """Identify the law `texsol` from triaxial tests.

    One fit over all samples and fitted pressures gives the values; one fit per sample and one per octant left out give
    the spread
    (`interval`). Held-out pressures are only predicted. `progress` receives one line per step of the work.

    Raises `InputError` (no tests, a pressure missing, no plastic flow, ...) and `ConvergenceError`.
    """
    options = options or IdentifyOptions()
    say = progress or (lambda _text: None)
    began = perf_counter()
    if not specimens:
        raise InputError("nothing to identify: give at least one specimen")
    pressures = sorted({float(level) for s in specimens for level in s.linked})
    held_out = tuple(level for level in pressures if any(abs(level - h) <= 1e-6 * level for h in options.held_out))
    fitted = tuple(level for level in pressures if level not in held_out)
    if len(fitted) < 2:
        raise InputError(
            f"{len(fitted)} fitted pressure(s): cohesion and friction need two or more (held out: {held_out})"
        )
    missing = [(s.seed, level) for s in specimens for level in fitted if level not in s.linked]
    if missing:
        raise InputError(
            f"specimen {missing[0][0]} has no linked test at {missing[0][1]:g} Pa: run it or leave the specimen out"
        )

    tests = [_tests(s.linked, fitted, options.split, None) or [] for s in specimens]
    say("fit over all samples")
    pooled = fit_law([t for group in tests for t in group], options, simulate)
    by_seed, seed_values, replicas, failed = [], [], [], 0
    for s, group in zip(specimens, tests, strict=True):
        say(f"sample {s.seed} and its octants")
        own = pooled if len(specimens) == 1 else fit_law(group, options, simulate, start=pooled)
        by_seed.append(own)
        seed_values.append(scalars(own))
        out, lost = _replicas(s.linked, fitted, options, simulate, own, True)
        replicas.append(out)
        failed += lost
    values = scalars(pooled)
    law = pooled.parameters

    control = None
    if any(all(level in s.control for level in fitted) for s in specimens):
        say("unlinked control")
        control, lost = _control(specimens, (values, seed_values, replicas), fitted, options, simulate)
        failed += lost

    say("predictions")
    predictions, mismatches = [], []
    for s in specimens:
        for linked, source in ((True, s.linked), (False, s.control)):
            for level in pressures:
                test = _tests(source, [level], options.split, None)
                if not test:
                    continue
                if linked or control is not None:
                    own_law = law if linked or control is None else control.fit.parameters
                    predictions.append(
                        predict(test[0], own_law, simulate, seed=s.seed, linked=linked, held_out=level in held_out)
                    )
                around = (
                    [_tests(source, [level], options.split, o) for o in range(OCTANTS)] if options.jackknife else []
                )
                mismatches.append(phase_mismatch(test[0], [r[0] for r in around if r], seed=s.seed, linked=linked))
    result = Identification(
        options=options,
        seeds=tuple(s.seed for s in specimens),
        fitted=fitted,
        held_out=held_out,
        law=law,
        pooled=pooled,
        by_seed=tuple(by_seed),
        estimates=_estimates(values, seed_values, replicas, options, _notes(pooled)),
        control=control,
        predictions=tuple(predictions),
        mismatches=tuple(mismatches),
        findings=(),
        failed_replicas=failed,
        seconds=perf_counter() - began,
    )
    return replace(result, findings=findings(result))
