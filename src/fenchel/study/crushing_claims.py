"""Part E: crushing of a cylinder (Figs. 4 and 5 of the study): 0.1 % between rough platens, 400 linear elements, three models.

Half a meridian section of 20 × 20 quadrilaterals, height over diameter 2, selective integration. The strains of the models differ, so
what holds at equal strain is a finding here. The force of ever finer meshes is extrapolated by Richardson's rule (1911), with the order
that three meshes show: the edges of the platens are singular.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..campaign import Computation, Task
from ..errors import FenchelError
from .claim import Claim, Part, Picture, Verdict, decided, judged, taken
from .crushing_runs import both_signs, refined, wire_map
from .models import MODELS, SETS
from .sizes import Size

__all__ = ["CRUSHING", "richardson"]

Array = NDArray[np.float64]

CLAIMS = (
    Claim(
        23, "N", "The cylinder is crushed by 0.1 % on 400 linear elements.",
        "Exactly 400 elements; their force within 2 % of that of infinitely fine meshes, for every model.",
    ),
    Claim(
        24, "T/Q", "The wire pressure of texsol is never positive; that of reinforced sand has both signs.",
        "Texsol: at most 1e-12 of the largest stress at all points and steps of all runs; reinforced sand: both signs at 0.1 % in one of "
        "the stated cases.",
    ),
    Claim(
        25, "Q", "The equivalent stress of the wires of texsol lies between those of sand (none) and reinforced sand.",
        "Largest value, mean and 95 % quantile of √J₂ between 0 and those of reinforced sand, three sets of parameters.",
    ),
    Claim(
        26, "Q", "Its map looks like that of reinforced sand.",
        "Pearson and Spearman correlation of the maps of √J₂ above 0.8, three sets.",
    ),
    Claim(
        27, "A", "The maps need rough platens.",
        "Smooth ones give uniform maps (to 1e-9) and the force of a material point; rough ones do not.",
    ),
)  # fmt: skip

MAPPED = ("table 3", "low cohesion", "demo_stiff")
SEARCHED = ("table 3", "frictional", "low cohesion", "demo_stiff")
SHAPES = (0.5, 1.0, 2.0)  # height over diameter
WORDS = {
    "table 3": "Table 3",
    "frictional": "Table 3, but θ_f = 0.3",
    "low cohesion": "Table 3, but θ_f = 0.3 and C_0 = 500 Pa",
    "demo_stiff": "stiff wires, θ_f = 0.3",
}
MESHED = (("sand", "selective"), ("reinforced", "selective"), ("texsol", "selective"), ("texsol", "full"))


def _map(name: str, model: str, platens: str = "rough") -> str:
    return f"E: map, {name}, {model}, {platens}"


def _mesh(model: str, columns: int, integration: str) -> str:
    return f"E: mesh {columns}, {model}, {integration}"


def _tasks(size: Size, folder: Path, wanted: frozenset[int]) -> list[Task]:
    tasks: list[Task] = []

    def add(name: str, function: Callable[..., dict[str, Any]], arguments: dict[str, Any], cost: float) -> None:
        tasks.append(Computation(name, function, folder, arguments, cost=cost))

    if wanted & CRUSHING.numbers:
        for name in MAPPED if wanted & {24, 25, 26} else ("table 3",):
            for model in MODELS:
                add(_map(name, model), wire_map, {"model": model, "name": name}, 0.3)
    if 23 in wanted:
        add("E: twice the steps", wire_map, {"model": "texsol", "name": "table 3", "steps": 20}, 0.5)
        for model, integration in MESHED:
            for n in size.columns:
                arguments = {"model": model, "columns": n, "integration": integration}
                add(_mesh(model, n, integration), refined, arguments, 0.1 + 6e-4 * n**2)
    if 24 in wanted:
        for name in SEARCHED:
            add(f"E: both signs, {name}", both_signs, {"name": name, "shapes": list(SHAPES)}, 0.8)
    if 27 in wanted:
        for model in MODELS:
            add(_map("table 3", model, "smooth"), wire_map, {"model": model, "name": "table 3", "rough": False}, 0.3)
    return tasks


def _judge(size: Size, _folder: Path, results: Mapping[str, Any], wanted: frozenset[int]) -> list[Verdict]:
    makers = {23: _elements, 24: _pressure, 25: _bounded, 26: _alike, 27: _platens}
    return judged(CLAIMS, wanted, lambda n: makers[n](size, results), needed="runs that converge")


def _maps(results: Mapping[str, Any], name: str, platens: str = "rough") -> dict[str, Any]:
    return {model: taken(results, _map(name, model, platens)) for model in MODELS}


def _settings(*names: str, **more: Any) -> dict[str, Any]:
    return {
        "sets [Pa, rad]": {name: SETS[name] for name in names or ("table 3",)}, "diameter [m]": 0.1, "height [m]": 0.2,
        "elements": "20 x 20 linear quadrilaterals, axisymmetric, selective integration", "shortening": 1e-3, "steps": 10,
        "lateral stress [Pa]": 0.0,
    } | more  # fmt: skip


def richardson(values: Array) -> tuple[float, float]:
    """Limit and order of a sequence whose meshes are refined twofold, from its last three values; the last value and nan where their
    differences do not shrink."""
    first, second = float(values[-3] - values[-2]), float(values[-2] - values[-1])
    if not (first * second > 0.0 and abs(first) > abs(second)):
        return float(values[-1]), float("nan")
    return float(values[-1]) - second / (first / second - 1.0), float(np.log2(first / second))


def _elements(size: Size, results: Mapping[str, Any]) -> Verdict:
    maps = _maps(results, "table 3")
    force = {model: float(m["force"][-1]) for model, m in maps.items()}
    meshes: dict[tuple[str, str], dict[str, Any]] = {}
    for model, integration in MESHED:
        found = [taken(results, _mesh(model, n, integration)) for n in size.columns]
        meshes[model, integration] = {key: np.array([f[key] for f in found]) for key in ("force", "max", "mean", "q95")}
        limit, order = richardson(meshes[model, integration]["force"])
        at_400 = float(meshes[model, integration]["force"][size.columns.index(20)])
        meshes[model, integration] |= {"limit": limit, "order": order, "400 elements over limit": at_400 / limit - 1.0}
    one, full = meshes["texsol", "selective"], meshes["texsol", "full"]
    worst = max(abs(meshes[model, "selective"]["400 elements over limit"]) for model in MODELS)
    twice = float(taken(results, "E: twice the steps")["force"][-1] / force["texsol"] - 1.0)
    elements = {model: m["elements"] for model, m in maps.items()}
    return Verdict(
        claim=23,
        outcome=decided(set(elements.values()) == {400} and worst < 0.02),
        sentence=f"400 elements; force on the platen at 0.1 %: sand {force['sand']:.2f} N, texsol {force['texsol']:.2f} N, "
        f"reinforced {force['reinforced']:.2f} N, {100 * worst:.2f} % off the limit of fine meshes at most (order {one['order']:.2f}). "
        f"Texsol with full integration is {100 * full['400 elements over limit']:.2f} % above its limit: hardly any locking. The two "
        f"limits differ by {100 * abs(full['limit'] / one['limit'] - 1.0):.2f} %, so sure is the extrapolation. Finer meshes raise the "
        f"largest √J₂ of the wires from {one['max'][0]:.0f} to {one['max'][-1]:.0f} Pa, for the edges of the platens are singular, but not "
        f"the 95 % quantile ({one['q95'][0]:.1f} to {one['q95'][-1]:.1f} Pa). Twice the steps change the force by {100 * twice:+.3f} %.",
        value=force["texsol"], unit="N",
        numbers={"force [N]": force, "elements": elements, "twice the steps": twice}
        | {f"{model}, {integration}": row for (model, integration), row in meshes.items()},
        settings=_settings(columns=list(size.columns)),
    )  # fmt: skip


def _first(found: Mapping[str, Array], shortening: Array) -> float:
    """Shortening from which on there are both signs; nan if there are none."""
    both = np.flatnonzero((found["lowest"] < 0.0) & (found["highest"] > 0.0))
    return float(shortening[both[0]]) if both.size else float("nan")


def _pressure(_size: Size, results: Mapping[str, Any]) -> Verdict:
    texsol, reinforced = ({name: _maps(results, name)[m] for name in MAPPED} for m in ("texsol", "reinforced"))
    highest = {n: max(float(m["highest"].max()), m["largest by difference"]) / m["scale"] for n, m in texsol.items()}
    apart = max(max(m["by law"], m["by difference"]) for m in (*texsol.values(), *reinforced.values()))
    range_ = {n: [float(m["lowest"][-1]), float(m["highest"][-1])] for n, m in reinforced.items()}
    both = [n for n, (low, high) in range_.items() if low < 0.0 < high]
    onset = {}
    for name in SEARCHED:
        found = taken(results, f"E: both signs, {name}")
        cases = [k for k in found if isinstance(found[k], Mapping) and "lowest" in found[k]]
        onset[name] = {case: _first(found[case], found["shortening"]) for case in sorted(cases)}
    holds = max(highest.values()) <= 1e-12 and apart <= 1e-12
    where = " and of ".join(WORDS[n] for n in both) or "none of the sets"
    low, high = range_["table 3"]
    table = _onsets(onset["table 3"])
    return Verdict(
        claim=24,
        outcome=decided(holds and bool(both)),
        sentence=f"Texsol: the largest wire pressure of all runs is {max(highest.values()):.1e} of the largest stress. Reinforced sand "
        f"has both signs at 0.1 % with the parameters of {where}, where dilation has outgrown elastic compaction. With Table 3 it has "
        f"one, {low:.0f} to {high:.0f} Pa ({table}). Between smooth platens there is one sign at a time.",
        value=max(highest.values()),
        numbers={
            "texsol: highest over scale": highest, "reinforced: range at 0.1 % [Pa]": range_, "ways to compute, apart over scale": apart,
            "both signs at 0.1 %": both, "both signs from a shortening of": onset,
        },
        settings=_settings(*SEARCHED, **{"height over diameter": list(SHAPES), "search": "10 x 10 elements, up to 1 % in 20 steps"}),
    )  # fmt: skip


def _onsets(onset: Mapping[str, float]) -> str:
    found = {shape: onset[f"rough, {shape:g}"] for shape in SHAPES}
    there = [f"at {100 * x:.2f} % with h/d = {shape:g}" for shape, x in found.items() if np.isfinite(x)]
    never = [f"{shape:g}" for shape, x in found.items() if not np.isfinite(x)]
    return "; ".join(
        [*(["first " + ", ".join(there)] if there else []), *([f"h/d = {', '.join(never)}: not up to 1 %"] if never else [])]
    )  # fmt: skip


MEASURES: dict[str, Callable[[Array, Array], float]] = {
    "max": lambda x, _w: float(x.max()),
    "mean": lambda x, w: float(np.average(x, weights=w)),
    "q95": lambda x, w: float(np.sort(x)[np.searchsorted(np.cumsum(w[np.argsort(x)]) / w.sum(), 0.95)]),
}


def _bounded(_size: Size, results: Mapping[str, Any]) -> Verdict:
    values, inside, points, equal = {}, {}, {}, {}
    for name in MAPPED:
        found = _maps(results, name)
        w = found["texsol"]["weights"]
        values[name] = {m: {k: f(found[m]["equivalent"], w) for k, f in MEASURES.items()} for m in MODELS}
        one, two = values[name]["texsol"], values[name]["reinforced"]
        inside[name] = all(values[name]["sand"][k] <= one[k] <= two[k] for k in MEASURES) and one["max"] > 0.0
        points[name] = float(np.average(found["texsol"]["equivalent"] <= found["reinforced"]["equivalent"], weights=w))
        equal[name] = found["texsol"]["below bilateral"]
    one, two = values["table 3"]["texsol"], values["table 3"]["reinforced"]
    return Verdict(
        claim=25,
        outcome=decided(all(inside.values()) and min(equal.values()) == 1.0),
        sentence=f"√J₂ of the wires with Table 3, texsol against reinforced: largest {one['max']:.0f} and {two['max']:.0f} Pa, "
        f"mean {one['mean']:.0f} and {two['mean']:.0f} Pa, 95 % quantile {one['q95']:.0f} and {two['q95']:.0f} Pa; sand has none. Point "
        f"by point the bound holds in {100 * min(points.values()):.1f} % of the volume at least over three sets; at equal strain it "
        "holds everywhere, as it must.",
        value=one["mean"] / two["mean"],
        numbers={"values [Pa]": values, "inside": inside, "share of the volume": points, "share at equal strain": equal},
        settings=_settings(*MAPPED),
    )  # fmt: skip


def _correlation(x: Array, y: Array, w: Array) -> float:
    """Pearson's, weighted by volume."""
    a, b = x - np.average(x, weights=w), y - np.average(y, weights=w)
    return float(np.sum(w * a * b) / np.sqrt(np.sum(w * a * a) * np.sum(w * b * b)))


def _alike(_size: Size, results: Mapping[str, Any]) -> Verdict:
    from scipy.stats import rankdata

    table: dict[str, dict[str, float]] = {}
    for name in MAPPED:
        found = _maps(results, name)
        one, two, w = found["texsol"], found["reinforced"], found["texsol"]["weights"]
        table[name] = {}
        for key in ("equivalent", "pressure"):
            table[name][f"{key}, pearson"] = _correlation(one[key], two[key], w)
            table[name][f"{key}, spearman"] = _correlation(rankdata(one[key]), rankdata(two[key]), w)
        scaled = [m["equivalent"] / m["equivalent"].max() for m in (one, two)]
        table[name]["equivalent, mean difference"] = float(np.average(np.abs(scaled[0] - scaled[1]), weights=w))
    worst = min(row[f"equivalent, {kind}"] for row in table.values() for kind in ("pearson", "spearman"))
    first = table["table 3"]
    rank = min(row["pressure, spearman"] for row in table.values())
    return Verdict(
        claim=26,
        outcome=decided(worst > 0.8),
        sentence=f"Maps of √J₂ over their largest value, Table 3: Pearson {first['equivalent, pearson']:.3f}, Spearman "
        f"{first['equivalent, spearman']:.3f}; {worst:.3f} at least over three sets. They are alike in form, not in level (claim 25). "
        f"Maps of the pressure are less so: {first['pressure, pearson']:.2f} and {first['pressure, spearman']:.2f} with Table 3, "
        f"Spearman {rank:.2f} at least.",
        value=worst, numbers=table, settings=_settings(*MAPPED, weights="volume"),
    )  # fmt: skip


def _platens(_size: Size, results: Mapping[str, Any]) -> Verdict:
    rough, smooth = _maps(results, "table 3"), _maps(results, "table 3", "smooth")

    def spread(found: Mapping[str, Any], key: str) -> float:
        return float(np.ptp(found[key]) / max(float(np.abs(found[key]).max()), 1e-300))

    measures = [(m, key) for m in ("reinforced", "texsol") for key in ("pressure", "equivalent")]
    uniform = max(spread(smooth[m], key) for m, key in measures)
    varied = min(spread(rough[m], key) for m, key in measures)
    point = max(abs(float(m["force"][-1]) / m["point force"] - 1.0) for m in smooth.values())
    excess = {m: float(rough[m]["force"][-1] / smooth[m]["force"][-1] - 1.0) for m in MODELS}
    return Verdict(
        claim=27,
        outcome=decided(uniform < 1e-9 and point < 1e-9 and varied > 0.01),
        sentence=f"Between smooth platens the maps vary by {uniform:.0e} of their largest value and the force is that of a material "
        f"point (to {point:.0e}); between rough ones they vary by {100 * varied:.0f} % or more, and the force is "
        f"{100 * min(excess.values()):.1f} to {100 * max(excess.values()):.1f} % larger.",
        value=uniform,
        numbers={
            "smooth": uniform, "rough, least": varied, "force against the point": point, "force, rough over smooth": excess,
        },
        settings=_settings(),
    )  # fmt: skip


def _pictures(size: Size, _folder: Path, results: Mapping[str, Any]) -> list[Picture]:
    from .crushing_figures import map_figure, mesh_figure, sign_figure

    def there(names: list[str]) -> bool:
        return all(name in results and not isinstance(results[name], FenchelError) for name in names)

    out = []
    shown = [name for name in MAPPED[:2] if there([_map(name, m) for m in MODELS])]
    if shown:
        cells = {WORDS[name]: {m: results[_map(name, m)]["cells"] for m in MODELS} for name in shown}
        out += [
            Picture(
                "wire_pressure", "Wire pressure at 0.1 % shortening, half section, rough platens. Tension is negative.",
                lambda: map_figure(cells, "pressure"),
                "Fig. 4: the pressure of texsol is nowhere positive; that of reinforced sand has both signs. Its parameters are not given.",
                "png",
            ),
            Picture(
                "wire_equivalent", "Equivalent stress √J₂ of the wires at 0.1 % shortening.", lambda: map_figure(cells, "equivalent"),
                "Fig. 5: that of texsol lies between sand and reinforced sand, distributed like that of the latter.", "png",
            ),
            Picture(
                "wire_form", "The same over the largest value of each map: form without level.",
                lambda: map_figure(cells, "equivalent", own_scale=True), kind="png",
            ),
        ]  # fmt: skip
    signs = {name: f"E: both signs, {name}" for name in SEARCHED}
    if there(list(signs.values())):
        out.append(Picture(
            "wire_signs", "Lowest and highest wire pressure of reinforced sand over the shortening, by height over diameter; mark: 0.1 %.",
            lambda: sign_figure({WORDS[name]: results[task] for name, task in signs.items()}, SHAPES),
        ))  # fmt: skip
    meshes = {key: [_mesh(key[0], n, key[1]) for n in size.columns] for key in MESHED}
    if there([name for names in meshes.values() for name in names]):
        forces = {key: np.array([results[name]["force"] for name in names]) for key, names in meshes.items()}
        excess = {key: 100.0 * (f / richardson(f)[0] - 1.0) for key, f in forces.items()}
        out.append(Picture(
            "crushing_meshes", "Force over its extrapolated limit; the mark is the mesh of 400 elements.",
            lambda: mesh_figure(np.array(size.columns), excess),
        ))  # fmt: skip
    return out


CRUSHING = Part("E", "Crushing of a cylinder", CLAIMS, _tasks, _judge, _pictures)
