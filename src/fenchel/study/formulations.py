"""Part B: the thermodynamics of the study, its two formulations, its two splits, its table of laws.

`formulation_energies` (4, 10), `formulation_equality` (5), `formulation_dissipation` (6), `formulation_rows` (7, 8) and
`formulation_splits` (9) compute, each over the laws of the library that the claim speaks of.
"""

from __future__ import annotations

from .claim import Claim
from .formulation_check import Check, part_of
from .formulation_dissipation import dissipations
from .formulation_energies import balances, superposition
from .formulation_equality import KINK, MODULUS, fenchel_equality
from .formulation_rows import LAW, rows_of_table, signs_of_forces
from .formulation_splits import LAWS, responses

__all__ = ["FORMULATIONS"]

_ALL = {"laws": "the library, at the values it keeps", "states": "random, of the size of each law's worked strain"}

CHECKS = (
    Check(
        claim=Claim(
            4, "T", "The power that is not stored is the same whether the free energy is written in the strain or in the stress.",
            "Both, and Σ A·α̇, agree to 1e-10 of the terms they are made of, along random processes of every energy.",
        ),
        name="B: power balance",
        function=balances,
        arguments=lambda s: {"seed": 4, "count": min(s.samples, 1000)},
        below={"forms": 1e-10, "reduced": 1e-10},
        above={"fewest": 20},
        sentence="Along {processes} random processes of the {energies} energies of the library the two forms of the inequality "
        "differ by at most {forms:.1e} of their terms, and from Σ A·α̇ by {reduced:.1e}.",
        headline="forms",
        held=_ALL | {"differences": "central, order 8, step 2e-3; processes whose window meets a kink of the wires left out"},
        cost=4.0,
    ),
    Check(
        claim=Claim(
            5, "T", "A stress belongs to a strain if and only if the strain belongs to the stress: ψ + ψ* = σ:ε.",
            "Residual at rounding by rule and by supremum, at solver precision by cone program, for every energy and for "
            "energies with kinks.",
        ),
        name="B: Fenchel equality",
        function=fenchel_equality,
        arguments=lambda s: {"seed": 5, "count": s.samples, "programs": max(3, s.samples // 100)},
        below={"equality": 1e-12, "below": 1e-12, "programs": 1e-6, "outside": 1e-9},
        sentence="ψ + ψ* − σ:ε vanishes to {equality:.1e} of its terms for {energies} energies of the library and {kinked} with kinks, "
        "{points} states each; certified programs agree to {programs:.1e}; at strains of other stresses it is nowhere below "
        "−{below:.1e}.",
        headline="equality",
        held=_ALL | {
            "energies with kinks": f"G = {MODULUS:g}, c = {KINK:g}", "wires alone": "rule everywhere, supremum and program in extension",
        },
        cost=8.0,
    ),
    Check(
        claim=Claim(
            6, "T", "Dissipation is the product of fluxes and forces, never negative, and the same in both splits and forms.",
            "At least −1e-12, equal in both splits to 1e-11, to the compiled step to 1e-9, in the stress form to 1e-7, all scaled.",
        ),
        name="B: dissipation",
        function=dissipations,
        arguments=lambda s: {"seed": 6, "paths": max(4, s.samples // 25), "steps": 6},
        below={"blocks": 1e-11, "step": 1e-9, "stress form": 1e-7, "negative": 1e-12, "idle": 0.0},
        above={"flowing": 0.1},
        sentence="Over {steps} compiled steps of {laws} laws flux times force is the same in both splits to {blocks:.1e}, in the "
        "compiled step to {step:.1e} and in the stress form to {stress_form:.1e}, and nowhere below −{negative:.1e}, "
        "relative to the energies of the step.",
        headline="blocks",
        held=_ALL | {"pieces of a path": 3, "differences": "central, order 8; steps next to a kink of the wires left out"},
        cost=8.0,
    ),
    Check(
        claim=Claim(
            7, "T", "All rows of the table of laws hold, those of the temperature and of the heat flux too.",
            "State laws by differences of ψ and ψ* to 1e-8; every inclusion of a rate or a force by its definition to 1e-9; "
            "no row unprinted.",
        ),
        name="B: rows of the table",
        function=rows_of_table,
        arguments=lambda s: {"seed": 7, "count": s.samples},
        below={"state": 1e-8, "inclusions": 1e-9, "negative": 0.0, "driving": 1e-11, "missing": 0},
        above={"plastic": 0.2},
        sentence="At {steps} steps of a thermo-elasto-plastic metal {rows} rows hold: state laws to {state:.1e}, the inclusions "
        "of rates and forces to {inclusions:.1e}, in both splits and both forms; each is printed.",
        headline="state",
        held={"law": LAW, "temperature [K]": "300 to 350", "temperature gradient [K/m]": "normal, 100", "trials of an inclusion": 20},
        cost=2.0,
    ),
    Check(
        claim=Claim(
            8, "T", "The printed signs of the force column are those of the conjugate in the first slot, not of the conjugate in all.",
            "−A and −∇T from the partial conjugate, +α̇ and +(−q/T) from the total one, by differences to 1e-9.",
        ),
        name="B: signs of the forces",
        function=signs_of_forces,
        arguments=lambda s: {"seed": 8, "count": s.samples, "potentials": max(5, s.samples // 40)},
        below={"partial": 1e-9, "total": 1e-9, "bend": 0.0, "phi": 1e-9},
        above={"printed, total": 1.9},
        sentence="For {potentials} random potentials and a metal that conducts heat the partial conjugate has the printed minus "
        "signs to {partial:.1e}, the total one plus signs to {total:.1e}; read with the total conjugate the printed "
        "column is wrong by {printed_total:.3g} times its value.",
        headline="partial",
        held={"law": LAW, "quadratic potentials": "a x²/2 + b x y + c y²/2, a and c from 0.5 to 2.5, b² < 0.81 ac"},
    ),
    Check(
        claim=Claim(
            9, "T", "Which strain is the state variable changes the laws and not the response.",
            "Stress and plastic strain of both splits, and the strain of the stress formulation, agree to 1e-8 along every path.",
        ),
        name="B: splits",
        function=responses,
        arguments=lambda s: {"seed": 9, "paths": max(4, s.samples // 50), "steps": 6},
        below={"stress": 1e-8, "state": 1e-8, "strain": 1e-8},
        above={"apex": 1, "least p": 1e-6},
        sentence="Along {steps} steps of sand, reinforced sand and texsol the law in the reversible strain, solved as its own "
        "system, gives the stress of the law in the total strain to {stress:.1e} and its plastic strain to {state:.1e}; "
        "driven by those stresses, the strain comes back to {strain:.1e}.",
        headline="stress",
        held={"laws": ", ".join(LAWS), "pieces of a path": 3, "end of a path": "isotropic extension of 0.8 %, to the apex"},
        cost=4.0,
    ),
    Check(
        claim=Claim(
            10, "T", "Phases at one strain whose stresses add up are the model put together; its conjugate is an infimal convolution.",
            "Stresses add to 1e-11; the least sum of both conjugates over shares of the stress is ψ* to 1e-7.",
        ),
        name="B: superposition",
        function=superposition,
        arguments=lambda s: {"seed": 10, "count": s.samples, "programs": max(4, s.samples // 50)},
        below={"sums": 1e-11, "shares": 1e-7, "share": 1e-4},
        above={"plastic": 0.2},
        sentence="At {strains} strains texsol and reinforced sand carry the sum of their phases to {sums:.1e}; shared out by a "
        "semidefinite program at {programs} stresses, the least ψ_s* + ψ_w* is ψ* to {shares:.1e}.",
        headline="shares",
        held={"laws": "sand, wire, texsol, reinforced_sand, at the values the library keeps"},
        cost=3.0,
    ),
)  # fmt: skip

FORMULATIONS = part_of("B", "Thermodynamic formulations", CHECKS)
