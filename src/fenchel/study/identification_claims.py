r"""Part L: identification. The arithmetic on the study's own table, planted data, and the law of our own tests.

Table 3 of the study gives, for confining pressures of 0.5 to 0.9 bar, E_w, E_s, τ_y, H_k, H_i. What its two fitted constants θ_f and C_0
can follow from is arithmetic; what a procedure can find at all, planted data show; what grains and wires give, the tests.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..campaign import Task
from ..identify.yielding import least_absolute_line, least_squares_line
from .claim import FAIL, PASS, UNDECIDED, Claim, Outcome, Part, Picture, Verdict, decided, judged, taken
from .grain_runs import PRESSURE
from .identification_runs import TABLE_3, identify_study, identify_tasks, planted_tasks
from .sizes import Size

__all__ = ["IDENTIFICATION", "STUDY_TABLE"]

Array = NDArray[np.float64]

CLAIMS = (
    Claim(64, "N", "ν = 0.2 for sand and wires.", "The interval of the fitted common ν contains 0.2; each phase fitted alone beside it."),
    Claim(
        65, "N", "E_s of 9.7 to 14.6 MPa, E_w of 0.31 to 0.41 MPa.",
        "Planted moduli come back to 1 %, with honest intervals under noise; own values of the same order, E_w/E_s beside 2 to 4 %.",
    ),
    Claim(66, "N", "θ_f = 0.079 rad and C_0 = 2842 Pa follow from the column τ_y.", "Least absolute deviations: within 1 % of both."),
    Claim(67, "N", "The value at 0.9 bar breaks the fit.", "Its residual is −4157 Pa; own yield stresses rise with the pressure."),
    Claim(68, "Q", "Parameters do not depend on pressure.", "Regression slopes of E_s, E_w, H over P contain 0; τ_y must rise."),
    Claim(
        69, "N", "H_i = H_k/2 in every row.",
        "Monotone tests find one number only: condition above 1e6, below 10 with a reversal; planted values come back only there.",
    ),
    Claim(70, "Q", "Model updating converges for the hardening moduli.", "Planted H_k and H_i come back to 1 % with a reversal."),
    Claim(
        71, "Q", "The identified law reproduces the discrete test.",
        "rms error of q below 15 % of its largest value on the fitted tests.",
    ),
)  # fmt: skip

STUDY_TABLE = {  # Laniel, Alart and Pagano (c. 2008), Table 3
    "P": np.array([5e4, 6e4, 7e4, 8e4, 9e4]),
    "E_w": 1e3 * np.array([405.4, 321.4, 305.1, 309.5, 318.7]),
    "E_s": 1e3 * np.array([11302.0, 12280.0, 9701.0, 14606.0, 12948.0]),
    "tau_y": np.array([6832.0, 6947.0, 8429.0, 9679.0, 5810.0]),
    "H_k": 1e3 * np.array([800.0, 1000.0, 1040.0, 960.0, 920.0]),
    "H_i": 1e3 * np.array([400.0, 500.0, 520.0, 480.0, 460.0]),
}


def _tasks(size: Size, folder: Path, wanted: frozenset[int]) -> list[Task]:
    tasks: list[Task] = []
    if wanted & {64, 65, 67, 68, 71}:
        tasks += identify_tasks(size, folder)
    if wanted & {65, 69, 70}:
        tasks += planted_tasks(size, folder)
    return tasks


def _law(results: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    found = taken(results, "L: identification")
    return json.loads(found["identification"]), found


def settings_of(size: Size) -> dict[str, Any]:
    """What the identified values depend on."""
    study = identify_study(size)
    assert study.wires is not None
    return {
        "grains": size.identify_grains, "seeds": size.identify_seeds, "pressures [Pa]": list(size.pressures),
        "held out [Pa]": list(size.held_out),
        "beads per grain": 2.0, "beads of a wire": study.wires.beads, "k [N]": study.wires.stiffness, "friction": study.grains.friction,
        "tolerance": study.solve.tolerance, "step / inertial time": study.solve.step, "wires": "free of tension at each pressure",
    }  # fmt: skip


def _judge(size: Size, _folder: Path, results: Mapping[str, Any], wanted: frozenset[int]) -> list[Verdict]:
    makers = {
        64: _poisson, 65: _moduli, 66: _yield_fit, 67: _outlier, 68: _constant, 69: _valley, 70: _updating, 71: _replayed,
    }  # fmt: skip
    return judged(CLAIMS, wanted, lambda n: makers[n](size, results), needed="runs that converge")


def _poisson(size: Size, results: Mapping[str, Any]) -> Verdict:
    law, own = _law(results)
    nu = law["estimates"]["nu"]
    alone = law["pooled"]["elastic"]["nu_sand_alone"]
    low, high = _interval(nu)
    inside = low is not None and high is not None and low <= 0.2 <= high
    return Verdict(
        claim=64,
        outcome=UNDECIDED if low is None else decided(inside),
        sentence=f"The common ν of our tests is {nu['value']:.3f}{_bracket(nu)}; the sand alone has {alone:.3f}, the wires alone "
        f"{own['nu_wire_alone']:.3f}: " + ("0.2 is in the interval." if inside else "0.2 is not in the interval.")
        + " The ratio of the contact stiffnesses, here 0.8, sets it.",
        value=nu["value"], low=low, high=high,
        numbers={"sand_alone": alone, "wire_alone": own["nu_wire_alone"]}, settings=settings_of(size),
        needed="at least 2 seeds for an interval" if low is None else "",
    )  # fmt: skip


def _interval(estimate: Mapping[str, Any]) -> tuple[float | None, float | None]:
    return estimate["low"], estimate["high"]


def _bracket(estimate: Mapping[str, Any], scale: float = 1.0, form: str = ".3g") -> str:
    if estimate["low"] is None:
        return ""
    return f" [{estimate['low'] / scale:{form}}, {estimate['high'] / scale:{form}}]"


def _moduli(size: Size, results: Mapping[str, Any]) -> Verdict:
    law, _ = _law(results)
    data = taken(results, "L: planted data")
    worst = max(abs(data[name][key]) for name in ("table_3", "grains") for key in ("E_s", "E_w", "nu"))
    noise = data["noise"]
    coverage = min(noise[f"{key}_coverage"] for key in ("E_s", "E_w", "nu"))
    E_s, E_w = law["estimates"]["E_s"], law["estimates"]["E_w"]
    # with n realisations a coverage of 95 % shows as 0.95 ± two binomial deviations
    honest = coverage >= 0.95 - 2.0 * np.sqrt(0.95 * 0.05 / noise["realisations"]) - 1e-9
    order = 1e6 < E_s["value"] < 1e8
    by_pressure = {k: v["value"] for k, v in law["estimates"].items() if k.startswith(("E_s@", "E_w@"))}
    return Verdict(
        claim=65,
        outcome=decided(worst < 0.01 and honest and order),
        sentence=f"Planted moduli come back to {worst:.1e} without noise, 95 % intervals hold them in {100 * coverage:.0f} % of "
        f"{noise['realisations']:.0f} realisations at least. Our samples: E_s = {E_s['value'] / 1e6:.1f}{_bracket(E_s, 1e6)} MPa, "
        f"E_w = {E_w['value'] / 1e3:.0f}{_bracket(E_w, 1e3)} kPa, E_w/E_s = {100 * E_w['value'] / E_s['value']:.2g} % (study: 2 to 4 %).",
        value=E_w["value"], unit="Pa", low=E_w["low"], high=E_w["high"],
        numbers={
            "planted_error": worst, "coverage": coverage, "E_s": E_s["value"], "E_w": E_w["value"], **by_pressure, "noise": dict(noise),
        },
        settings=settings_of(size),
    )  # fmt: skip


def _yield_fit(_size: Size, _results: Mapping[str, Any]) -> Verdict:
    t = STUDY_TABLE
    robust, squares = least_absolute_line(t["P"], t["tau_y"]), least_squares_line(t["P"], t["tau_y"])
    good = abs(robust.angle / 0.079 - 1.0) < 0.01 and abs(robust.C_0 / 2842.0 - 1.0) < 0.01
    return Verdict(
        claim=66,
        outcome=decided(good),
        sentence=f"Least absolute deviations of the study's five values give θ_f = {robust.angle:.4f} rad and C_0 = "
        f"{robust.C_0:.1f} Pa (printed: "
        f"0.079 and 2842); least squares give {squares.angle:.4f} rad and {squares.C_0:.0f} Pa. The line runs through the values "
        f"at 0.5 and 0.7 "
        "bar, and another one is as good by this measure.",
        value=robust.angle, unit="rad",
        numbers={
            "C_0_least_absolute": robust.C_0, "theta_least_absolute": robust.angle, "unique": robust.unique,
            "C_0_least_squares": squares.C_0,
            "theta_least_squares": squares.angle,
        },
        settings={"data": "Table 3 of the study"},
    )  # fmt: skip


def _outlier(size: Size, results: Mapping[str, Any]) -> Verdict:
    t = STUDY_TABLE
    residual = float(t["tau_y"][-1] - (2842.0 + t["P"][-1] * np.tan(0.079)))
    law, _ = _law(results)
    tau = {float(k.split("@")[1]): v["value"] for k, v in law["estimates"].items() if k.startswith("tau_y@")}
    ordered = [tau[p] for p in sorted(tau)]
    rising = all(b > a for a, b in pairwise(ordered))
    told = ", ".join(f"{tau[p] / 1e3:.1f} kPa at {p / 1e3:g} kPa" for p in sorted(tau))
    return Verdict(
        claim=67,
        outcome=decided(abs(residual + 4157.0) < 1.0 and rising),
        sentence=f"The value at 0.9 bar lies {-residual:.0f} Pa below the published line. Our yield stresses (0.02 % offset): {told}"
        + (", rising." if rising else ", not rising throughout."),
        value=residual, unit="Pa",
        numbers={"residual": residual, **{f"tau_y@{p:g}": v for p, v in tau.items()}}, settings=settings_of(size),
    )  # fmt: skip


def _slope(x: Array, y: Array) -> tuple[float, float, float]:
    """Slope of the line through (x, y) relative to the mean of y, per relative change of x, with its 95 % interval."""
    from scipy.stats import linregress
    from scipy.stats import t as student

    fit: Any = linregress(np.log(x), y / y.mean())
    half = float(student.ppf(0.975, len(x) - 2)) * float(fit.stderr) if len(x) > 2 else float("nan")
    return float(fit.slope), float(fit.slope) - half, float(fit.slope) + half


def _constant(size: Size, results: Mapping[str, Any]) -> Verdict:
    law, own = _law(results)
    seeds = law["by_seed"]
    columns: dict[str, tuple[Array, Array]] = {}
    for name in ("E_s", "E_w", "tau_y"):
        rows = [
            (float(k.split("@")[1]), v["seed_values"]) for k, v in law["estimates"].items() if k.startswith(f"{name}@")
        ]
        x = np.array([p for p, values in rows for _ in values])
        columns[name] = (x, np.array([v for _, values in rows for v in values], dtype=float))
    columns["H_eff"] = (np.asarray(own["pressures"], float), np.asarray(own["H_eff_by_pressure"], float))
    slopes = {name: _slope(*column) for name, column in columns.items()}
    study = {name: _slope(STUDY_TABLE["P"], STUDY_TABLE[name]) for name in ("E_s", "E_w", "H_k", "H_i", "tau_y")}
    still = {name: low <= 0.0 <= high for name, (_, low, high) in slopes.items()}
    constant = all(still[name] for name in ("E_s", "E_w", "H_eff"))
    told = ", ".join(f"{name} {s:.2f} [{low:.2f}, {high:.2f}]" for name, (s, low, high) in slopes.items())
    theirs = ", ".join(f"{name} [{low:.2f}, {high:.2f}]" for name, (_, low, high) in study.items())
    return Verdict(
        claim=68,
        outcome=decided(constant and slopes["tau_y"][0] > 0.0),
        sentence=f"Relative change per relative change of the pressure: {told}; in the study's table: {theirs}. "
        f"τ_y {'rises' if slopes['tau_y'][0] > 0 else 'does not rise'}, as a cone demands.",
        value=slopes["E_s"][0], low=slopes["E_s"][1], high=slopes["E_s"][2],
        numbers={
            **{f"slope_{name}": list(s) for name, s in slopes.items()}, **{f"study_slope_{name}": list(s) for name, s in study.items()},
            "samples": len(seeds),
        },
        settings=settings_of(size),
    )  # fmt: skip


def _valley(size: Size, results: Mapping[str, Any]) -> Verdict:
    data = taken(results, "L: planted data")
    monotone = min(data[n]["condition"]["monotone"] for n in ("table_3", "grains"))
    reversal = max(data[n]["condition"]["reversal"] for n in ("table_3", "grains"))
    only_there = not any(data[n]["monotone"]["separable"] for n in ("table_3", "grains"))
    back = max(abs(data[n][k]) for n in ("table_3", "grains") for k in ("H_k", "H_i"))
    tied = float(np.abs(STUDY_TABLE["H_i"] / STUDY_TABLE["H_k"] - 0.5).max())
    return Verdict(
        claim=69,
        outcome=decided(monotone > 1e6 and reversal < 10.0 and only_there and back < 0.01),
        sentence=f"In monotone tests the sensitivities to H_k and H_i have a condition number of {monotone:.1e}, with a reversal "
        f"into extension "
        f"{reversal:.1f}; planted values come back to {back:.1e} there, and not without. All rows of the study have H_i = H_k/2 "
        f"(to {tied:.0e}): "
        "one number was identified, H_eff.",
        value=monotone,
        numbers={
            "condition_monotone": monotone, "condition_reversal": reversal, "error_reversal": back,
            "H_k_error_monotone": data["table_3"]["monotone"]["H_k_error"],
            "H_eff_error_monotone": data["table_3"]["monotone"]["H_eff_error"],
            "condition_unloading_in_compression": data["table_3"]["condition"]["unloading"],
        },
        settings={"planted": {"table_3": TABLE_3.to_json()}, "pressures [Pa]": [5e4, 7e4, 9e4], "path": [0.0, -0.01, 0.006, -0.01]},
    )  # fmt: skip


def _updating(_size: Size, results: Mapping[str, Any]) -> Verdict:
    data = taken(results, "L: planted data")
    back = {f"{n}_{k}": abs(data[n][k]) for n in ("table_3", "grains") for k in ("H_k", "H_i")}
    worst = max(back.values())
    return Verdict(
        claim=70, outcome=decided(worst < 0.01), sentence=f"Planted H_k and H_i come back to {worst:.1e} from tests with a reversal.",
        value=worst, numbers=back, settings={"pressures [Pa]": [5e4, 7e4, 9e4], "path": [0.0, -0.01, 0.006, -0.01]},
    )  # fmt: skip


def _replayed(size: Size, results: Mapping[str, Any]) -> Verdict:
    law, _ = _law(results)
    linked = [p for p in law["predictions"] if p["linked"]]
    fitted = [p["error_q"] for p in linked if not p["held_out"]]
    held = [p["error_q"] for p in linked if p["held_out"]]
    worst, mean = max(fitted), float(np.sqrt(np.mean(np.square(fitted))))
    outcome: Outcome = PASS if mean < 0.15 else FAIL
    values = law["law"]
    return Verdict(
        claim=71,
        outcome=outcome,
        sentence=f"The law of the joint fit replays q of the fitted tests with {100 * mean:.1f} % rms of its largest value (worst "
        f"{100 * worst:.1f} %), "
        f"and predicts the pressure held out with {100 * float(np.mean(held)):.1f} %. θ_f = {values['theta_f']:.3f} rad, C_0 = "
        f"{values['C_0']:.0f} Pa, H_k = {values['H_k'] / 1e6:.2f} MPa, H_i = {values['H_i'] / 1e6:.2f} MPa.",
        value=mean, numbers={"fitted": fitted, "held_out": held, **{f"law_{k}": v for k, v in values.items()}}, settings=settings_of(size),
    )  # fmt: skip


def _pictures(size: Size, folder: Path, results: Mapping[str, Any]) -> list[Picture]:
    from .identification_figures import surface_figure, table_figure

    out = [
        Picture("yield_fit", "τ_y of the study's table over the confining pressure, and the lines that can be fitted.",
                lambda: table_figure(STUDY_TABLE), "Table 3 of the study; its text gives θ_f = 0.079 rad and C_0 = 2842 Pa."),
    ]  # fmt: skip
    data = results.get("L: planted data")
    if isinstance(data, dict):
        out.append(
            Picture(
                "surface", "Misfit of q over (H_k, H_i) around planted values: a valley without a reversal, a bowl with one.",
                lambda: surface_figure(data["surface"]),
            )
        )  # fmt: skip
    found = results.get("L: identification")
    if isinstance(found, dict):
        from .identification_figures import replay_figure

        out.append(
            Picture(
                "replay", f"Grains (grey) and identified law (blue) at {PRESSURE / 1e3:g} kPa and at the pressure held out, seed 1.",
                lambda: replay_figure(size, folder, json.loads(found["identification"])),
            )
        )  # fmt: skip
    return out


IDENTIFICATION = Part("L", "Identification", CLAIMS, _tasks, _judge, _pictures)
