r"""Part D: cyclic compression (Fig. 3 of the study). One element, 20 loops of shortening and back, three models.

What stabilises, and where, depends on parameters that the study does not give: the claims are tested at three stated sets and over a sweep
in five directions. Stabilised: both end forces change by less than 0.1 % of the larger one from a loop to the next, from there on.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..campaign import Computation, Task
from ..errors import FenchelError
from .claim import Claim, Part, Picture, Verdict, decided, judged, taken
from .cyclic_runs import CRITERIA, LONG, LOOPS, elastic_slopes, in_order, loops_of, refinements, slope, table_rows
from .cyclic_sweep import AXES, NAMES, WIRED, Sweep, axis_points, largest_box, main_effects, sweep_line, sweep_slice
from .models import MODELS, SETS
from .sizes import Size

__all__ = ["CYCLIC"]

CLAIMS = (
    Claim(
        17, "Q", "The curves of all three models are stable after 20 loops.",
        "End forces change by less than 1 % in loop 20 (three sets).",
    ),
    Claim(
        18, "Q", "With wires of either kind the loops stabilise earlier than those of sand alone.",
        "At every point of a box that holds a tenth of the sweep or more, sand takes more loops than both.",
    ),
    Claim(
        19, "Q", "With wires they stabilise nearer to zero displacement.",
        "Displacement at zero force in loop 20 smaller than that of sand by more than 5 %, at both sets with stiff wires.",
    ),
    Claim(
        20, "Q", "Texsol alone has two slopes, one in tension and one in compression.",
        "Elastic slopes equal the closed forms to 1e-9; their ratio is 1.0236 and 1.4219 for texsol at Table 3 and E_w/E_s = 0.5, else 1.",
    ),
    Claim(
        21, "Q", "Texsol lies between the two other models.",
        "Largest compression of every loop: sand ≤ texsol ≤ reinforced (three sets).",
    ),
    Claim(
        22, "A", "With the moduli of Table 3 next to nothing is left of the order of 18 and 19.",
        "Loops to stabilise within one of each other, displacements at zero force within 5 % of that of sand.",
    ),
)  # fmt: skip

STATED = ("demo_stiff", "stiff", "table 3")
ONE = CRITERIA.index(1e-3)
SEED = 20


def _loops(name: str) -> str:
    return f"D: loops, {name}"


def _slice(ratio: float) -> str:
    return f"D: sweep at E_w to E_s = {ratio:.4f}"


def _tasks(size: Size, folder: Path, wanted: frozenset[int]) -> list[Task]:
    table: list[tuple[frozenset[int], str, Any, dict[str, Any]]] = [
        (frozenset({17, 19, 20, 21, 22}), _loops(name), loops_of, {"values": SETS[name]}) for name in STATED
    ]
    table += [
        (frozenset({18, 19, 21}), _slice(x), sweep_slice, {"ratio": x, "count": size.sweep})
        for x in axis_points("ratio", size.sweep).tolist()
    ]
    table += [(frozenset({18}), f"D: line along {name}", sweep_line, {"name": name}) for name in AXES]
    table += [
        (frozenset({17}), "D: steps and element", refinements, {"name": "demo_stiff", "steps": [20, 40, 80]}),
        (frozenset({20}), "D: loops into extension", loops_of, {"values": SETS["stiff"], "extension": 1.0}),
        (frozenset({20}), "D: slopes", elastic_slopes, {"seed": SEED, "samples": min(size.samples, 1000)}),
        (frozenset({22}), "D: rows of Table 3", table_rows, {}),
    ]
    cost = {sweep_slice: 0.01 * size.sweep**4}
    return [
        Computation(name, function, folder, arguments, cost=cost.get(function, 0.1))
        for claims, name, function, arguments in table
        if claims & wanted
    ]


def _judge(size: Size, _folder: Path, results: Mapping[str, Any], wanted: frozenset[int]) -> list[Verdict]:
    makers = {17: _stable, 18: _earlier, 19: _nearer, 20: _slopes, 21: _between, 22: _table_3}
    return judged(CLAIMS, wanted, lambda n: makers[n](size, results), needed="runs that can be followed")


def _stated(results: Mapping[str, Any]) -> dict[str, Any]:
    return {name: taken(results, _loops(name)) for name in STATED}


def _settings(**more: Any) -> dict[str, Any]:
    return {
        "sets [Pa, rad]": {name: SETS[name] for name in STATED}, "stroke u/H": 2e-3, "loops": LOOPS, "steps per half loop": 40,
        "lateral stress [Pa]": 0.0, "loop": "0 to -u to 0",
    } | more  # fmt: skip


def _sweep(size: Size, results: Mapping[str, Any]) -> Sweep:
    return Sweep([taken(results, _slice(x)) for x in axis_points("ratio", size.sweep).tolist()])


def _swept(s: Sweep) -> dict[str, Any]:
    axes = {NAMES[name]: values for name, values in s.axes.items()}
    return _settings(sweep=axes, criterion=CRITERIA[ONE], **{"loops followed": LONG, "E_s of the sweep [Pa]": 12e6})


def _stable(_size: Size, results: Mapping[str, Any]) -> Verdict:
    last = {name: {m: float(found[m]["change"][-1]) for m in MODELS} for name, found in _stated(results).items()}
    checks = taken(results, "D: steps and element")
    worst = max(max(row.values()) for row in last.values())
    strict = [f"{model} of {name}" for name, row in last.items() for model, x in row.items() if x >= 1e-3]
    counts = {m: checks["loops"][m].tolist() for m in MODELS}
    same = "the same" if all(len(set(row)) == 1 for row in counts.values()) else "other"
    return Verdict(
        claim=17,
        outcome=decided(worst < 0.01 and max(checks["element"].values()) < 1e-7),
        sentence=f"In loop 20 the end forces change by {100 * worst:.2f} % at most over three sets of parameters. The strict 0.1 % is "
        f"{'met by all' if not strict else 'not met by ' + ', '.join(strict)}. Half and twice the steps give {same} counts of loops to "
        f"stabilise, and one linear finite element the forces of the material point (to {max(checks['element'].values()):.0e}).",
        value=worst,
        numbers={
            "change": last, "not below 0.1 %": strict, "loops at 20, 40, 80 steps": counts, "element": checks["element"],
            "residual at 20, 40, 80 steps": {m: checks["residual"][m].tolist() for m in MODELS},
        },
        settings=_settings(),
    )  # fmt: skip


def _earlier(size: Size, results: Mapping[str, Any]) -> Verdict:
    s = _sweep(size, results)
    holds = s.earlier[ONE]
    box = largest_box(holds)
    points = holds[box].size if box else 0
    effects = dict(zip(NAMES.values(), main_effects(holds.astype(float)), strict=True))
    first, second = sorted(effects, key=lambda k: -effects[k])[:2]
    by_axis = {
        NAMES[name]: [float(holds.take(i, axis=k).mean()) for i in range(size.sweep)] for k, name in enumerate(AXES)
    }
    later = float(np.any([s.loops["sand"][ONE] < s.loops[m][ONE] for m in WIRED], axis=0).mean())
    where = f"among them all {points} points with {s.region(box)}" if box else "in no box of it"
    return Verdict(
        claim=18,
        outcome=decided(points >= 0.1 * holds.size),
        sentence=f"True at {100 * holds.mean():.0f} % of the {holds.size} points of the sweep, {where}; at {100 * later:.0f} % one of "
        f"the two takes longer than sand, at the others a count is equal. {first} decides most, then {second}: by themselves they "
        f"explain {100 * effects[first]:.0f} and {100 * effects[second]:.0f} % of the variance.",
        value=float(holds.mean()),
        numbers={
            "points": holds.size, "points of the region": points, "region": s.region(box) if box else "none", "reversed": later,
            "share by criterion": {f"{c:g}": float(h.mean()) for c, h in zip(CRITERIA, s.earlier, strict=True)},
            "variance explained": effects, "share along": by_axis,
        },
        settings=_swept(s),
    )  # fmt: skip


def _shares(found: Mapping[str, Any]) -> dict[str, float]:
    """|u| at zero force in loop 20 over that of sand."""
    sand = abs(float(found["sand"]["residual"][-1]))
    return {m: abs(float(found[m]["residual"][-1])) / sand for m in WIRED}


def _nearer(size: Size, results: Mapping[str, Any]) -> Verdict:
    shares = {name: _shares(found) for name, found in _stated(results).items()}
    s = _sweep(size, results)
    there = np.all([np.isfinite(r) for r in s.residual.values()], axis=0)
    near = np.all([s.residual[m] < 0.95 * s.residual["sand"] for m in WIRED], axis=0) & there
    worst = max(x for name in ("stiff", "demo_stiff") for x in shares[name].values())
    demo, low = shares["demo_stiff"], shares["stiff"]
    effects = dict(zip(NAMES.values(), main_effects(near.astype(float)), strict=True))
    first = max(effects, key=lambda k: effects[k])
    return Verdict(
        claim=19,
        outcome=decided(worst < 0.95),
        sentence=f"Stiff wires: zero force is met at {100 * demo['reinforced']:.0f} % (reinforced) and {100 * demo['texsol']:.0f} % "
        f"(texsol) of the shortening of sand with θ_f = 0.3, at {100 * low['reinforced']:.0f} and {100 * low['texsol']:.0f} % with "
        f"0.079. Over the sweep both are nearer by more than 5 % at {100 * near.sum() / max(there.sum(), 1):.0f} % of the {there.sum()} "
        f"points where the force of all three comes back to zero; {first} decides most.",
        value=worst,
        numbers={
            "u over that of sand": shares, "points": int(there.sum()), "points nearer by 5 %": int(near.sum()),
            "variance explained": effects,
        },
        settings=_swept(s),
    )  # fmt: skip


def _slopes(size: Size, results: Mapping[str, Any]) -> Verdict:
    found, extended = taken(results, "D: slopes"), taken(results, "D: loops into extension")
    stated = _stated(results)
    worst = max(found["worst"].values())
    ratios = found["ratios"]
    one_sided = max(abs(ratios[name][m] - 1.0) for name in STATED for m in ("sand", "reinforced"))
    expected = abs(ratios["table 3"]["texsol"] - 1.0236) < 1e-4 and abs(ratios["stiff"]["texsol"] - 1.4219) < 1e-4
    ends = {"into extension": _ends(extended)} | {name: _ends(found) for name, found in stated.items()}
    here, far = ends["stiff"]["texsol"], ends["into extension"]["texsol"]
    closed = {
        name: slope("texsol", SETS["stiff"], volume=volume, lateral=True, axial=axial)
        for name, volume, axial in (("compression", False, False), ("growing volume", True, False), ("extension", True, True))
    }  # fmt: skip
    return Verdict(
        claim=20,
        outcome=decided(worst <= 1e-9 and one_sided <= 1e-9 and expected),
        sentence=f"Slope in tension over that in compression: {ratios['stiff']['texsol']:.4f} at E_w/E_s = 0.5, "
        f"{ratios['table 3']['texsol']:.4f} at Table 3, 1 for the other models; closed forms met to {worst:.0e} at random moduli. Loops "
        f"from 0 to −u never extend the wires along the axis: there texsol changes from {here[0] / 1e6:.2f} to {here[1] / 1e6:.2f} MPa "
        f"only, by growing volume. Loops from −u to +u show {far[0] / 1e6:.2f} and {far[1] / 1e6:.2f} MPa.",
        value=ratios["stiff"]["texsol"],
        numbers={
            "ratios": ratios, "worst against closed forms": found["worst"], "slopes after both ends of loop 20 [Pa]": ends,
            "closed forms for texsol, stiff [Pa]": closed,
        },
        settings=_settings(
            seed=SEED, samples=min(size.samples, 1000),
            **{"E_s drawn [Pa]": [3e6, 3e7], "E_w/E_s drawn": [0.01, 3.16], "nu drawn": [0.0, 0.45]},
        ),
    )  # fmt: skip


def _ends(found: Mapping[str, Any]) -> dict[str, list[float]]:
    """Slopes [Pa] after the lower and after the upper end of the last loop whose both ends were left."""
    return {m: [float(found[m]["slope_low"][-2]), float(found[m]["slope_high"][-1])] for m in MODELS}


def _between(size: Size, results: Mapping[str, Any]) -> Verdict:
    peaks = {name: {m: -found[m]["low"] for m in MODELS} for name, found in _stated(results).items()}
    inside = {name: in_order(p) for name, p in peaks.items()}
    share = float(_sweep(size, results).ordered.mean())
    last = peaks["demo_stiff"]
    return Verdict(
        claim=21,
        outcome=decided(all(inside.values())),
        sentence="Largest compression in loop 20, stiff wires: "
        + ", ".join(f"{m} {last[m][-1] / 1e3:.1f} kPa" for m in ("sand", "texsol", "reinforced"))
        + f"; the order holds in every loop at {sum(inside.values())} of {len(inside)} sets and at {100 * share:.0f} % of the sweep.",
        value=share,
        numbers={
            "ordered": inside, "share of the sweep": share,
            "peak of loop 20 [Pa]": {n: {m: float(p[m][-1]) for m in MODELS} for n, p in peaks.items()},
        },
        settings=_settings(),
    )  # fmt: skip


def _table_3(_size: Size, results: Mapping[str, Any]) -> Verdict:
    found, rows = taken(results, _loops("table 3")), taken(results, "D: rows of Table 3")
    counts = {m: int(found[m]["stabilised"][ONE]) for m in MODELS}
    shares = _shares(found)
    spread = max(counts.values()) - min(counts.values())
    of_rows = np.ptp(np.stack([rows["loops"][m] for m in MODELS]), axis=0)
    least = {m: float(np.min(rows["residual"][m] / rows["residual"]["sand"])) for m in WIRED}
    most = {m: float(np.max(rows["residual"][m] / rows["residual"]["sand"])) for m in WIRED}

    def nearer(x: float) -> str:
        return f"{100.0 * (1.0 - x):.1f}"

    gone = spread <= 1 and all(0.95 < x < 1.05 for x in shares.values())
    return Verdict(
        claim=22,
        outcome=decided(gone),
        sentence=f"With the means of Table 3 the loops to stabilise are {counts['sand']} (sand), {counts['texsol']} (texsol) and "
        f"{counts['reinforced']} (reinforced): that order is gone. Zero force is met nearer to zero displacement, but by "
        f"{nearer(shares['texsol'])} % (texsol) and {nearer(shares['reinforced'])} % (reinforced) only. In the five rows counts "
        f"differ by {of_rows.max()} at most; texsol is nearer by {nearer(most['texsol'])} to {nearer(least['texsol'])} %, "
        f"reinforced sand by {nearer(most['reinforced'])} to {nearer(least['reinforced'])} %.",
        value=1.0 - shares["texsol"],
        numbers={
            "loops": counts, "u over that of sand": shares, "rows": {"pressure [Pa]": rows["pressure"], "loops": rows["loops"]},
            "rows: least u over that of sand": least, "rows: most": most,
        },
        settings=_settings(criterion=CRITERIA[ONE]),
    )  # fmt: skip


def _pictures(size: Size, _folder: Path, results: Mapping[str, Any]) -> list[Picture]:
    from .cyclic_figures import line_figure, loop_figure, sweep_figure

    def there(names: list[str]) -> bool:
        return all(name in results and not isinstance(results[name], FenchelError) for name in names)

    out = []
    shown = {
        "stiff wires, θ_f = 0.3": _loops("demo_stiff"),
        "stiff wires, θ_f = 0.079, −u to +u": "D: loops into extension",
        "Table 3": _loops("table 3"),
    }
    shown = {title: name for title, name in shown.items() if there([name])}
    if shown:
        out.append(Picture(
            "cyclic_loops", f"{LOOPS} loops of the three models; a dot marks zero force in the last loop.",
            lambda: loop_figure({title: results[name] for title, name in shown.items()}),
            "Fig. 3: force against displacement of one element. Texsol and reinforced sand settle first and nearer to zero displacement; "
            "texsol changes its slope between tension and compression. Moduli and stroke are not given.",
        ))  # fmt: skip
    if there([_slice(x) for x in axis_points("ratio", size.sweep).tolist()]):
        s = _sweep(size, results)
        out.append(Picture(
            "cyclic_sweep", "Every point of the sweep: how many loops sooner than sand the slower one of texsol and reinforced sand "
            "stabilises. Rings: not sooner.",
            lambda: sweep_figure(s.axes, s.loops["sand"][ONE] - np.maximum(*(s.loops[m][ONE] for m in WIRED))),
        ))  # fmt: skip
    lines = {name: f"D: line along {name}" for name in AXES}
    if there(list(lines.values())):
        out.append(Picture(
            "cyclic_lines", f"One parameter at a time, the others those of stiff wires with θ_f = 0.3 and u/H = 0.2 %. Top: loops to "
            f"stabilise ({LONG + 1}: more than were run). Bottom: axial strain at zero force in loop 20 (no mark: compressed all along).",
            lambda: line_figure({name: results[task] for name, task in lines.items()}, ONE),
        ))  # fmt: skip
    return out


CYCLIC = Part("D", "Cyclic compression", CLAIMS, _tasks, _judge, _pictures)
