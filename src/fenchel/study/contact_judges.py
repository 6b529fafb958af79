"""What follows from the computations of part F: one verdict for each of its claims."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .claim import Verdict, decided
from .contact_onestep import COMPARED
from .contact_scenes import fitted_exponent
from .wire_graphs import LAWS

__all__ = ["JUDGES"]

Results = Mapping[str, Any]
Settings = dict[str, Any]
Fit = tuple[float, float, float]  # exponent with its 95 % interval


def _told(fit: Fit) -> str:
    return f"{fit[0]:.2f} [{fit[1]:.2f}, {fit[2]:.2f}]"


def _listed(fits: Mapping[str, Fit]) -> dict[str, float]:
    return {
        f"exponent, {name}{end}": fit[k] for name, fit in fits.items() for k, end in enumerate(("", ", low", ", high"))
    }


def _operator(r: Results, settings: Settings) -> Verdict:
    o, c = r["F: operator"], r["F: conservation"]
    kept = max(c[name][what] for name in ("touching", "apart") for what in ("momentum", "angular"))
    numbers = {
        "asymmetry": o["asymmetry"], "least eigenvalue / largest": o["least_eigenvalue"], "matrix-free product": o["product"],
        "velocities after the step": o["step"], "contacts": o["contacts"], "dependent rows": o["dependent_rows"],
        "momentum, touching": c["touching"]["momentum"], "angular momentum, touching": c["touching"]["angular"],
        "momentum, apart": c["apart"]["momentum"], "angular momentum less moment of gaps, apart": c["apart"]["angular"],
        "moment of gaps, apart": c["apart"]["moment_of_gaps"],
    }  # fmt: skip
    holds = o["asymmetry"] < 1e-12 and o["least_eigenvalue"] > -1e-12 and o["product"] < 1e-12 and o["step"] < 1e-11
    sentence = (
        f"Over {o['contacts']} contacts the matrix-free product equals W r within {o['product']:.0e}, and W r + q the velocities "
        f"that the sweeps left within {o['step']:.0e}; the least eigenvalue is {o['least_eigenvalue']:.0e} of the largest. Momentum "
        f"and angular momentum change by {kept:.0e}. Contacts across a gap turn by its moment, {c['apart']['moment_of_gaps']:.0e} here."
    )
    outcome = decided(bool(holds and kept < 1e-13 and o["contacts"] > 0 and c["closed"] > 0))
    return Verdict(claim=28, outcome=outcome, sentence=sentence, value=o["product"], numbers=numbers, settings=settings)


def _complementarity(r: Results, settings: Settings) -> Verdict:
    found = r["F: complementarity"]
    worst = max(f[name] for f in found.values() for name in COMPARED)
    rows, problems, late = (sum(f[what] for f in found.values()) for what in ("rows", "problems", "unfinished"))
    numbers = {
        f"{name}: {what}": f[what]
        for name, f in found.items()
        for what in (*COMPARED, "rows", "problems", "unfinished", "sweeps_of_unfinished", "longest")
    }
    sentence = (
        f"On {rows} normal rows of {problems} steps the velocities of sweeps, solver, Lemke's pivots and active sets differ by at most "
        f"{worst:.0e} of the largest approach, optima and complementarity included."
    )
    if late:
        off = max(f["sweeps_of_unfinished"] for f in found.values())
        among = ", ".join(
            f"{f['unfinished']} of {f['problems']} with {name}" for name, f in found.items() if f["unfinished"]
        )
        sentence += (
            f" In {late} of them ({among}) the sweeps had not ended at the limit, velocities off by up to {off:.0e}."
        )
    used = all(f["closed"] > 0 and f["unfinished"] < f["problems"] for f in found.values())
    outcome = decided(bool(worst < 1e-8 and used and found["compliant grains"]["unfinished"] == 0))
    return Verdict(claim=29, outcome=outcome, sentence=sentence, value=worst, numbers=numbers, settings=settings)


def _friction(r: Results, settings: Settings) -> Verdict:
    f, scale = r["F: friction"], r["F: residuals"]
    error, words = max(f["map"], f["swept_map"]), max(f["words"], f["swept_words"])
    program = max(f["cone"], f["swept_cone"])
    numbers = dict(f)
    for name in ("compliant", "rigid"):
        for k, tolerance in enumerate(scale["tolerances"]):
            for q, label in enumerate(("median", "90 %", "99 %", "largest")):
                numbers[f"{name} packing, tolerance {tolerance:g}, {label}"] = float(scale[name][k, q])
    used = min(f["arrived"], f["swept"], f["sliding"]) > 0
    # cone programs are solved to gaps of 1e-11, energy distances are their square roots
    holds = used and error < 1e-8 and words < 1e-7 and program < 1e-5 and f["arrived_map"] < 1e-5
    middle = len(scale["tolerances"]) // 2
    elsewhere = f" or, in {f['elsewhere']}, of another one" if f["elsewhere"] else ""
    sentence = (
        f"{f['problems']} small problems: natural map {error:.0e}, energy distance from the cone program of the own slip "
        f"{program:.0e}. The sweeps ended in {f['swept']}; the fixed point from rest stood still in {f['arrived']}, within "
        f"{f['arrived_apart']:.0e} of a solution known{elsewhere}. In {f['several']} sweeps and solver end at different solutions, each "
        f"within these bounds. In a packing of {scale['contacts']} contacts a tolerance of {scale['tolerances'][middle]:.0e} leaves "
        f"{scale['total_rigid'][middle]:.0e}, and {scale['rigid'][middle, 3]:.0e} of the mean impulse at the worst contact."
    )
    return Verdict(
        claim=30, outcome=decided(bool(holds)), sentence=sentence, value=error, numbers=numbers, settings=settings
    )


def _sweeps(r: Results, settings: Settings) -> Verdict:
    b, k = r["F: sweeps over bodies"], r["F: sweeps over stiffness"]
    grains = np.repeat(b["grains"], b["rigid"].shape[1]).astype(float)
    rising = (k["ratios"] >= 1.0) & (k["ratios"] <= 1e3)
    fits = {
        "columns": fitted_exponent(b["rows"], b["columns"]),
        "rigid chains": fitted_exponent(b["rows"], b["chains"]),
        "rigid packings": fitted_exponent(grains, b["rigid"].ravel()),
        "compliant packings": fitted_exponent(grains, b["compliant"].ravel()),
        "chain over k": fitted_exponent(k["ratios"][rising], k["chain"][rising]),
        "packings over k": fitted_exponent(np.repeat(k["ratios"], k["packings"].shape[1]), k["packings"].ravel()),
    }
    steps, ended = b["steps"] + k["steps"], b["ended"] + k["ended"]
    numbers = _listed(fits) | {
        "steps": steps, "ended": ended, "most sweeps of a rigid packing": float(b["rigid"].max()),
        "sweeps of the rigid chain": k["limit"], "sweeps of the stiffest chain": float(k["chain"][-1]),
    }  # fmt: skip
    told = {name: _told(fit) for name, fit in fits.items()}
    sentence = (
        f"{ended} of {steps} steps reached their tolerance. Sweeps grow with the number of bodies to the power {told['columns']} in "
        f"columns, {told['rigid chains']} in rigid chains, {told['rigid packings']} in rigid and {told['compliant packings']} in "
        f"compliant packings; with k between 1 and 1000 k_c to the power {told['chain over k']} in a chain, and "
        f"{told['packings over k']} in packings."
    )
    value, low, high = fits["columns"]
    return Verdict(
        claim=31, outcome=decided(ended == steps), sentence=sentence, value=value, low=low, high=high, numbers=numbers,
        settings=settings | {"fit": "least squares of logarithms, 95 % Student", "tolerance": "1e-8 in rows, 1e-4 in packings"},
    )  # fmt: skip


def _laws(r: Results, settings: Settings) -> Verdict:
    found, limit = r["F: four graphs"], r["F: rigid limit"]
    errors = {f"{name}: {what}": found[name][what] for name in LAWS for what in ("pair", "chain", "algebra")}
    worst = max(errors.values())
    least = {name: found[name]["least_tension"] for name in LAWS}
    pulls_only = min(least["rigid wire"], least["elastic wire"]) >= 0.0
    k = np.repeat(limit["ratios"], limit["rod"].shape[1])
    fits = {kind: fitted_exponent(k, (limit[kind] / limit[kind][0]).ravel()) for kind in ("rod", "wire")}
    numbers = errors | {f"{name}: least tension [N]": t for name, t in least.items()} | _listed(fits)
    straight = all(abs(fit[0] + 1.0) < 0.02 for fit in fits.values())
    both_ways = max(least["rigid rod"], least["elastic rod"]) < 0.0
    sentence = (
        f"Links lie within {worst:.0e} of the graphs; wires never push, rods do. Elastic links come to the rigid ones as k to the "
        f"power {fits['rod'][0]:.4f} (rods) and {fits['wire'][0]:.4f} (wires)."
    )
    value, low, high = max(fits.values(), key=lambda fit: abs(fit[0] + 1.0))
    return Verdict(
        claim=32, outcome=decided(bool(worst < 1e-9 and pulls_only and straight and both_ways)), sentence=sentence, value=value,
        low=low, high=high, numbers=numbers, settings=settings | {"scale of the strains": 0.01, "k of single links [N]": 100.0},
    )  # fmt: skip


def _bending(r: Results, settings: Settings) -> Verdict:
    found, fold = r["F: bending"], r["F: folding"]
    numbers = {f"{name}: {what}": v for name in LAWS for what, v in found[name].items()}
    worst, across = max(numbers.values()), max(found[name]["across"] for name in LAWS)
    fits = {name: fitted_exponent(fold["steps"], fold[name]) for name in ("rigid rod", "rigid wire")}
    lost = max(float(fold[name][-1]) for name in fits)
    numbers |= {
        f"{n} steps, share of energy lost": float(v) for n, v in zip(fold["steps"], fold["rigid rod"], strict=True)
    }
    numbers |= _listed(fits) | {"angle reached [°]": fold["angle"]}
    sentence = (
        f"Impulses across links are {across:.0e} of those along them, spins do not change, and velocities of pure folding stay within "
        f"{worst:.0e}. Half a turn of one half of a chain costs {lost:.0e} of its energy in {fold['steps'][-1]} steps, which falls as "
        f"the number of steps to the power {fits['rigid rod'][0]:.2f}."
    )
    holds = worst < 1e-12 and lost < 1e-3 and max(fit[0] for fit in fits.values()) < -1.5 and fold["angle"] > 179.0
    return Verdict(
        claim=33, outcome=decided(bool(holds)), sentence=sentence, value=across, numbers=numbers, settings=settings
    )


def _buckling(r: Results, settings: Settings) -> Verdict:
    found = r["F: buckling"]
    counts, long = found["counts"], found["counts"] > 2
    ratio, peak = found["ratio"][long], found["peak"][long]
    numbers = {f"{n} points, push / pull": float(v.max()) for n, v in zip(counts, found["ratio"], strict=True)}
    numbers |= {
        f"{n} points, largest push on the way / pull": float(v.max())
        for n, v in zip(counts, found["peak"], strict=True)
    }
    sentence = (
        f"Pushed by 1 %, chains of {counts[long][0]} to {counts[-1]} points carry at most {100 * ratio.max():.2g} % of what they pull; "
        f"two points carry {100 * found['ratio'][~long].min():.0f} %. On the way, before they have bowed out, they push with up to "
        f"{100 * peak.max():.0f} %."
    )
    return Verdict(
        claim=34, outcome=decided(bool(ratio.max() < 0.01 and found["ratio"][~long].min() > 0.99)), sentence=sentence,
        value=float(ratio.max()), low=float(ratio.min()), high=float(ratio.max()), numbers=numbers,
        settings=settings | {"k [N]": found["stiffness"], "strain": 0.01, "interval": "least and largest over the chains"},
    )  # fmt: skip


def _weighing(r: Results, settings: Settings) -> Verdict:
    found = r["F: weighing"]
    momentum, hanging = (max(found[name][what] for name in LAWS) for what in ("momentum", "hanging"))
    numbers = {f"{name}: {what}": v for name in LAWS for what, v in found[name].items()}
    numbers |= {"sample: off equal shares": found["sample"], "sample: mass per length [kg/m]": found["linear_density"]}
    sentence = (
        f"Momentum under gravity and the force from which a string hangs are those of the sum of the beads within {momentum:.0e} and "
        f"{hanging:.0e}; the beads of a sample share equally. They have the mass of grains there, {1e3 * found['linear_density']:.2g} "
        "g/m where a yarn has about 0.01 g/m: a scaling that quasi-static tests allow."
    )
    outcome = decided(bool(momentum < 1e-12 and hanging < 1e-9 and found["sample"] < 1e-12))
    return Verdict(claim=35, outcome=outcome, sentence=sentence, value=hanging, numbers=numbers, settings=settings)


def _motion(r: Results, settings: Settings) -> Verdict:
    flight, slide, pile = r["F: flight and bounce"], r["F: sliding"], r["F: stack"]
    swing, hung = r["F: pendulum"], r["F: catenary"]
    rate = fitted_exponent(swing["steps"], swing["error"])
    e = flight["restitutions"]
    errors = {  # with the bound of each
        "flight": (max(flight["speed"], flight["place"]), 1e-10),
        "restitution": (float(np.max(np.abs(flight["found"] - e))), 1e-10),
        "height of the rebound": (float(np.max(np.abs(flight["rise"] - e**2))), 0.02),
        "angle of sliding": (float(np.max(np.abs(slide["angle"] / np.arctan(slide["coefficients"]) - 1.0))), 1e-9),
        "acceleration of sliding": (float(np.max(np.abs(slide["acceleration"]))), 1e-9),
        "creep below the angle [m/s]": (slide["creep"], 1e-14),
        "stack": (pile["error"], 1e-8),
        "pendulum": (float(swing["error"][-1]), 1e-4),
        "hung chain, tension": (max(hung[n]["tension_error"] for n in ("rod", "wire")), 1e-5),
        "hung chain, shape": (max(hung[n]["place_error"] for n in ("rod", "wire")), 1e-5),
    }
    found = {name: error for name, (error, _) in errors.items()}
    missed = [name for name, (error, bound) in errors.items() if not error <= bound]
    sentence = (
        f"Off the closed forms: flight {found['flight']:.0e}, restitution {found['restitution']:.0e}, onset of sliding "
        f"{found['angle of sliding']:.0e}, stack {found['stack']:.0e}, hung chain {found['hung chain, tension']:.0e}; the tension of the "
        f"pendulum {found['pendulum']:.0e} of the weight, which falls as the number of steps to the power {rate[0]:.2f}."
    )
    if missed:
        sentence += f" Beyond their bounds: {', '.join(missed)}."
    return Verdict(
        claim=36, outcome=decided(not missed), sentence=sentence, value=found["hung chain, tension"],
        numbers=found | _listed({"pendulum": rate}),
        settings=settings | {f"bound, {name}": bound for name, (_, bound) in errors.items()},
    )  # fmt: skip


JUDGES: dict[int, Callable[[Results, Settings], Verdict]] = {
    28: _operator, 29: _complementarity, 30: _friction, 31: _sweeps, 32: _laws, 33: _bending, 34: _buckling, 35: _weighing, 36: _motion,
}  # fmt: skip
