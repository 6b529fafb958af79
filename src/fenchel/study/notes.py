"""Part M: what a reader of the study should know before comparing figures with it. Notes, not claims."""

from __future__ import annotations

__all__ = ["NOTES"]

NOTES = {
    72: "Once in its text the study writes the reversible strain with the symbol of the irreversible one; fenchel reads ε = ε^r + ε^ir.",
    73: "Its force function [7] is the indicator of one joint set of (A, χ, R); read as an indicator in A alone, hardening would never "
    "evolve.",
    74: "θ_f = 0.079 rad (4.5°) marks where irreversible strain begins. It is no friction angle of a sand and no slope angle.",
    75: "21.56 mm is 54 mean radii, 4.29 mm is 4: the two samples have grains of 0.40 and 1.07 mm. Lengths compare in radii only.",
    76: "Table 3 gives a slope switch of 2.4 %; the switch that Fig. 3 shows by eye belongs to a far stiffer network.",
    77: "Bead radius, k, friction, grain number, step and tolerance are not given: discrete figures can agree in order of magnitude only, "
    "and none stands here without what it depends on.",
}  # fmt: skip
