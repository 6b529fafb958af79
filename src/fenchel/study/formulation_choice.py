"""Which formulation to identify with: strain side, stress side, or the duality gap between both (costs: see `cost_functions`).

The rule, by the numbers alone. (1) Planted data: the least relative error under noise (root mean square over unknowns, sets, noises and
seeds, each counted as 1 at most, a fit that failed as 1). Grains: the least error of q at confining pressures that were left out of the
fit (of samples, if there is one pressure). An error that is at most a quarter larger than the least and not told apart from it (95 %
interval of the mean log ratio, paired by seed or by what was left out) counts as equal to it. (2) Of these, one whose scaled Jacobian has
more than ten times the least condition number stands back. (3) Of the rest, the one that takes the fewest steps of the law is first. As no
law is exact for grains, they say what to identify with where they are given.

The cost "axial" makes just that error of q small on the tests that it sees; so all four costs are measured on what was left out too, each
relative to the best of them, and their geometric mean stands beside. The other three costs see the volume: where grains contract, a law
whose plastic flow dilates by tan θ_f can please them only by giving friction up, which the yield points, read apart, show.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..campaign import Computation
from ..errors import FenchelError
from .claim import Picture
from .cost_functions import COSTS, FREE, NAMES
from .formulation_choice_figures import grains_figure, planted_figure
from .formulation_fits import NOISES, SETS, choice_of, discrete_choice, planted_choice
from .sizes import Size
from .statistics import mean_of

__all__ = ["choice_of", "discrete_choice", "pictures", "summary", "table", "tasks", "verdict_sentence"]

Array = NDArray[np.float64]
TITLES = {
    "axial": "strain formulation (axial strain)", "strain": "strain formulation (whole strain)", "stress": "stress formulation",
    "gap": "duality gap",
}  # fmt: skip
SHORT = {"axial": "axial strain", "strain": "whole strain", "stress": "stress", "gap": "gap"}
DRIVEN_BY = {"axial": "strain 1 %", "strain": "strain 1 %", "stress": "stress 1 %"}
SHOWN = "both 1 %"
TIE, WORSE = 1.25, 10.0

Results = Mapping[str, Any]


def tasks(size: Size, folder: Path) -> list[Computation]:
    """Planted data, a task for every set of parameters and cost."""
    seeds = max(8, size.samples // 25)
    return [
        Computation(f"choice: {name}, {cost}", planted_choice, folder, {"name": name, "cost": cost, "seeds": seeds})
        for name in SETS
        for cost in COSTS
    ]


# -- numbers ----------------------------------------------------------------------------------------------------------------------


def _found(results: Results, kind: str) -> list[Mapping[str, Any]]:
    return [r for r in results.values() if isinstance(r, Mapping) and r.get("kind") == kind]


def _capped(error: Array) -> Array:
    """Relative errors, 1 at most and for a fit that failed."""
    return np.minimum(np.nan_to_num(np.abs(error), nan=1.0), 1.0)


def _rms(parts: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.square(np.concatenate([_capped(part).ravel() for part in parts])))))


def _mean(values: Any) -> float:
    found = np.asarray(values, dtype=float)
    found = found[np.isfinite(found)]
    return float(found.mean()) if found.size else float("nan")


def _geometric(values: Any) -> float:
    return float(np.exp(np.mean(np.log(np.asarray(values, dtype=float)))))


def _planted(mine: Sequence[Mapping[str, Any]], cost: str) -> dict[str, Any]:
    """Of one cost, over the sets."""
    cells = [r["noise"][label] for r in mine for label in NOISES]
    shown = [r["noise"][SHOWN] for r in mine]
    halves = np.concatenate([cell["half"] for cell in cells])
    errors = np.concatenate([cell["error"] for cell in cells])
    held = np.abs(errors) <= halves
    driver = DRIVEN_BY.get(cost)
    gains = np.concatenate([r["noise"][driver]["gain"] for r in mine]) if driver else []
    free = [r[f"{SHOWN}, E_s free"] for r in mine]
    return {
        "rms": _rms([cell["error"] for cell in cells]),
        "rms by noise": {label: _rms([r["noise"][label]["error"] for r in mine]) for label in NOISES},
        "rms by unknown": {name: _rms([cell["error"][:, k] for cell in cells]) for k, name in enumerate(NAMES)},
        "bias": _rms([np.nanmean(cell["error"], axis=0) for cell in shown]),
        "deviation": _rms([np.nanstd(cell["error"], axis=0, ddof=1) for cell in shown]),
        "bias without noise": float(max(_capped(r["clean"]["error"]).max() for r in mine)),
        "half-width": _mean(halves),
        "coverage": float(np.mean(held)),
        "coverage by unknown": {name: float(np.mean(held[:, k])) for k, name in enumerate(NAMES)},
        "condition": _geometric([r["clean"]["condition"] for r in mine]),
        "evaluations": _mean(np.concatenate([cell["evaluations"] for cell in cells])),
        "law steps": _mean(np.concatenate([cell["law_steps"] for cell in cells])),
        "law steps without noise": _mean([r["clean"]["law_steps"] for r in mine]),
        "failed": int(sum(np.sum(cell["failed"]) for cell in cells)),
        "fits": int(errors.shape[0]),
        "false flow": _mean(np.concatenate([cell["drift"] for cell in shown])),
        "amplification": _mean(gains),
        "without hardening": float(max(r["no hardening"] for r in mine)),
        "E_s free": {
            "rms": _rms([cell["error"][:, :4] for cell in free]), "rms of E_s": _rms([cell["error"][:, 4] for cell in free]),
            "condition": _geometric([r["clean, E_s free"]["condition"] for r in mine]),
            "failed": int(sum(np.sum(cell["failed"]) for cell in free)),
        },
    }  # fmt: skip


def _by_draw(mine: Sequence[Mapping[str, Any]]) -> Array:
    """Root mean square error over the unknowns, (sets, noises, seeds)."""
    return np.array(
        [[np.sqrt(np.mean(_capped(r["noise"][label]["error"]) ** 2, axis=1)) for label in NOISES] for r in mine]
    )


def _discrete(whole: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Array]]:
    """Of the grains, what is left out by pressure if there are several, else by sample; and the errors of q there, one by one."""
    fits = whole["fits"]
    kinds = [k for k in ("pressure", "sample") if all(fits[c][f"left {k}"]["groups"] for c in COSTS)]
    out: dict[str, Any] = {key: whole[key] for key in ("tests", "samples", "E_s", "E_w", "nu", "t_yield", "C_0_yield")}
    out["left out"] = kinds[0] if kinds else "nothing"
    left = {c: fits[c][f"left {kinds[0]}"]["measured"] if kinds else fits[c]["measured"][None] for c in COSTS}
    every = {c: np.sqrt(np.mean(np.square(left[c]), axis=0)) for c in COSTS}
    least = np.min(list(every.values()), axis=0)
    for cost in COSTS:
        mine, free = fits[cost], whole["E_s free"][cost]
        spread = {k: mine[f"left {k}"]["deviation"] for k in ("sample", "pressure") if mine[f"left {k}"]["groups"]}
        out[cost] = {
            "q left out": float(every[cost][0]), "q": mine["q"], "all costs": _geometric(every[cost] / least),
            "measured": dict(zip(COSTS, mine["measured"].tolist(), strict=True)),
            "measured left out": dict(zip(COSTS, every[cost].tolist(), strict=True)),
            "values": dict(zip(NAMES, mine["values"].tolist(), strict=True)),
            "half-width": dict(zip(NAMES, mine["half"].tolist(), strict=True)),
            "deviation": {k: dict(zip(NAMES, np.asarray(v).tolist(), strict=True)) for k, v in spread.items()},
            "noise moves": dict(zip(NAMES, mine["noise moves"].tolist(), strict=True)),
            "condition": mine["condition"], "law steps": float(mine["law_steps"]), "failed": int(mine["failed"]),
            "E_s free": {"q": free["q"], **dict(zip(FREE, free["values"].tolist(), strict=True))},
        }  # fmt: skip
    return out, {cost: measured[:, 0] for cost, measured in left.items()}


def _apart(mine: Array, least: Array) -> bool:
    """Whether errors, paired, are told to be more than the least; a single one is not."""
    return mean_of(np.log(np.maximum(mine, 1e-300) / np.maximum(least, 1e-300))).low > 0.0


def _ranked(numbers: Mapping[str, Mapping[str, Any]], first: str, paired: Mapping[str, Array]) -> dict[str, Any]:
    """The best cost by the rule, and all by the error: `first` names it, pooled, and `paired` holds what it was pooled from."""
    costs = sorted(COSTS, key=lambda c: numbers[c][first])
    near = [c for c in costs if numbers[c][first] <= TIE * numbers[costs[0]][first]]
    equal = [c for c in near if c == costs[0] or not _apart(paired[c], paired[costs[0]])]
    condition = {c: v if np.isfinite(v := numbers[c]["condition"]) else np.inf for c in equal}
    good = [c for c in equal if condition[c] <= WORSE * min(condition.values())]
    best = min(good, key=lambda c: numbers[c]["law steps"])
    return {"order": ", ".join(costs), "best": best, "equal": ", ".join(equal)}


def _whole(rows: Mapping[tuple[str, str], Any]) -> list[str]:
    """Sets of parameters for which every cost is there."""
    return [name for name in SETS if all((name, cost) in rows for cost in COSTS)]


def summary(results: Results) -> dict[str, Any]:
    """All numbers of the comparison, from the results of the tasks that are there ("choice: ..." and, of any name, `discrete_choice`)."""
    out: dict[str, Any] = {
        "failed tasks": sum(isinstance(r, FenchelError) for name, r in results.items() if name.startswith("choice: "))
    }
    rows = {(r["set"], r["cost"]): r for r in _found(results, "planted")}
    whole = _whole(rows)
    if whole:
        planted = {cost: _planted([rows[name, cost] for name in whole], cost) for cost in COSTS}
        errors = {cost: _by_draw([rows[name, cost] for name in whole]) for cost in COSTS}  # (sets, noises, seeds)
        best = np.argmin([errors[cost] for cost in COSTS], axis=0)
        for k, cost in enumerate(COSTS):
            planted[cost]["best in"] = int(np.sum(best == k))
        by_noise = {label: min(COSTS, key=lambda c: planted[c]["rms by noise"][label]) for label in NOISES}
        seeds = {cost: np.sqrt(np.mean(np.square(e), axis=(0, 1))) for cost, e in errors.items()}
        out["planted"] = {
            **planted,
            **_ranked(planted, "rms", seeds),
            "best by noise": by_noise,
            "draws": int(best.size),
            "seeds": int(best.shape[-1]),
        }
    discrete = _found(results, "discrete")
    if discrete:
        grains, left = _discrete(discrete[0])
        out["discrete"] = {**grains, **_ranked(grains, "q left out", left)}
        out["discrete"]["best by all costs"] = min(COSTS, key=lambda c: grains[c]["all costs"])
    if "planted" in out or discrete:
        out["best"] = out["discrete" if discrete else "planted"]["best"]
    return out


# -- words ------------------------------------------------------------------------------------------------------------------------


def verdict_sentence(found: Mapping[str, Any]) -> str:
    """What to identify with, and the figures that say so."""
    if "best" not in found:
        return "No formulation is chosen: the fits are not there."
    said = f"Identify with: {TITLES[found['best']]}."
    if "planted" in found:
        p = found["planted"]

        def each(key: str, form: str) -> str:
            return _listed(p["order"], lambda c: format(p[c][key], form))

        kinds = (("the stress", "stress 1 %"), ("the strain", "strain 1 %"))
        alone = ", ".join(f"on {what} alone {SHORT[p['best by noise'][label]]}" for what, label in kinds)
        said += (
            f" Where the law is exact, {TITLES[p['best']]} comes first: relative error under noise {each('rms', '.1%')} (rms of "
            f"{p['draws']} draws{_equals(p, 'seed')}; with noise {alone}); condition number {each('condition', '.0f')}; steps of the law "
            f"{each('law steps', '.0f')}; 95 % intervals hold {each('coverage', '.0%')}; noise of 1 % adds flow "
            f"{each('false flow', '+.2%')}."
        )
    if "discrete" in found:
        d = found["discrete"]
        what = "on the tests fitted" if d["left out"] == "nothing" else f"where a {d['left out']} was left out"
        missed = _listed(d["order"], lambda c: format(d[c]["q left out"], ".1%"))
        every = _listed(d["order"], lambda c: format(d[c]["all costs"], ".2f"))
        friction = _listed(d["order"], lambda c: format(d[c]["values"]["t"], ".2f"))
        said += (
            f" For grains {TITLES[d['best']]} comes first: error of q {what} {missed}{_equals(d, d['left out'])}; tan θ_f found "
            f"{friction}, by the yield points {d['t_yield']:.2f}; misfits by all four costs over the least of each {every}."
        )
    return said


def _listed(order: str, say: Callable[[str], str]) -> str:
    return ", ".join(f"{SHORT[cost]} {say(cost)}" for cost in order.split(", "))


def _equals(found: Mapping[str, Any], by: str) -> str:
    """Which costs the errors do not tell apart."""
    equal = found["equal"].split(", ")
    return f", not told apart by {by}: {', '.join(SHORT[c] for c in equal)}" if len(equal) > 1 else ""


def table(found: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """A row for every cost."""
    head, columns = ["cost"], [[TITLES[cost] for cost in COSTS]]

    def add(title: str, group: str, say: Callable[[Mapping[str, Any]], str]) -> None:
        head.append(title)
        columns.append([say(found[group][cost]) for cost in COSTS])

    if "planted" in found:
        add("error without noise", "planted", lambda n: f"{n['bias without noise']:.0e}")
        for label in NOISES:
            add(f"rms error, noise {label}", "planted", lambda n, label=label: f"{n['rms by noise'][label]:.1%}")
        root = np.sqrt(found["planted"]["seeds"])
        add("bias at 1 %", "planted", lambda n: f"{n['bias']:.1%} (of chance {n['deviation'] / root:.1%})")
        add("scatter at 1 %", "planted", lambda n: f"{n['deviation']:.1%}")
        add("half of the 95 % interval", "planted", lambda n: f"{n['half-width']:.1%}")
        add("held by it", "planted", lambda n: f"{n['coverage']:.0%}")
        add("condition", "planted", lambda n: f"{n['condition']:.1f}")
        add("condition, E_s free", "planted", lambda n: f"{n['E_s free']['condition']:.1f}")
        add("evaluations", "planted", lambda n: f"{n['evaluations']:.0f}")
        add("law steps", "planted", lambda n: f"{n['law steps']:.0f}")
        add("failed", "planted", lambda n: f"{n['failed']} of {n['fits']}")
        add("best in", "planted", lambda n: f"{n['best in']} of {found['planted']['draws']}")
        add("flow added at 1 %", "planted", lambda n: f"{n['false flow']:+.2%}")
        add("noise out over noise in", "planted", lambda n: f"{n['amplification']:.1f}".replace("nan", "–"))
        add("misfit without hardening", "planted", lambda n: f"{n['without hardening']:.2g}")
    if "discrete" in found:
        add("grains: q left out", "discrete", lambda n: f"{n['q left out']:.1%}")
        add("grains: q fitted", "discrete", lambda n: f"{n['q']:.1%}")
        for cost in COSTS[1:]:
            add(f"grains: misfit of {TITLES[cost]}", "discrete", lambda n, cost=cost: f"{n['measured'][cost]:.1%}")
        add("grains: all costs over the best", "discrete", lambda n: f"{n['all costs']:.2f}")
        for name, unit in (("t", 1.0), ("C_0", 1e3), ("H_k", 1e6), ("H_i", 1e6)):
            shown = "tan θ_f" if name == "t" else f"{name} [{'kPa' if unit == 1e3 else 'MPa'}]"
            add(f"grains: {shown}", "discrete", lambda n, name=name, unit=unit: _with_spread(n, name, unit))
    return head, [list(row) for row in zip(*columns, strict=True)]


def _with_spread(numbers: Mapping[str, Any], name: str, unit: float) -> str:
    value = f"{numbers['values'][name] / unit:.3g}"
    spread = [d[name] for d in numbers["deviation"].values()]
    return f"{value} ± {max(spread) / unit:.2g}" if spread else value


# -- pictures ---------------------------------------------------------------------------------------------------------------------


def pictures(results: Results) -> list[Picture]:
    """Bias and scatter of every unknown, and condition numbers; of the grains, the table of misfits."""
    found = summary(results)
    out = []
    if "planted" in found:
        out.append(
            Picture(
                "formulation_choice",
                "Planted data, noise of 1 % on stresses (of the pressure) and on strains (of 0.1 %): relative error of every unknown, mean "
                "(bar) and standard deviation over the seeds, by the cost that was made small; condition number of the scaled Jacobian.",
                partial(planted_figure, _shown(results), TITLES),
            )
        )
    if "discrete" in found:
        out.append(
            Picture(
                "formulation_grains",
                "Tests of grains: every fit measured by every cost, on the tests fitted and on what was left out.",
                partial(grains_figure, found["discrete"], TITLES),
            )
        )
    return out


def _shown(results: Results) -> dict[str, dict[str, Any]]:
    """What the picture of the planted data shows, of the sets that are whole."""
    rows = {(r["set"], r["cost"]): r for r in _found(results, "planted")}
    return {
        name: {
            cost: {
                "error": rows[name, cost]["noise"][SHOWN]["error"],
                "condition": [rows[name, cost][key]["condition"] for key in ("clean", "clean, E_s free")],
            }
            for cost in COSTS
        }
        for name in _whole(rows)
    }
