"""One identification of one set of tests, in its stages: elastic moduli, yield line, hardening."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .curves import Curves, by_pressure
from .elastic import ElasticFit, elastic_moduli
from .hardening import HardeningFit, fit_hardening
from .options import IdentifyOptions
from .parameters import LawParameters
from .replay import Simulate
from .yielding import YieldFit, fit_yield

__all__ = ["UNITS", "LawFit", "fit_law", "scalars", "strength"]

#: Unit of every scalar; the part before "@" is the key. Stresses in Pa.
UNITS = {
    "nu": "1",
    "E_s": "Pa",
    "E_w": "Pa",
    "E_w_bilateral": "Pa",
    "theta_f_staged": "rad",
    "C_0_staged": "Pa",
    "H_eff_staged": "Pa",
    "H_k_staged": "Pa",
    "H_i_staged": "Pa",
    "theta_f": "rad",
    "C_0": "Pa",
    "H_eff": "Pa",
    "H_k": "Pa",
    "H_i": "Pa",
    "tau_y": "Pa",
    "theta_f_own": "rad",
    "C_0_own": "Pa",
    "theta_f_study": "rad",
    "C_0_study": "Pa",
    "q": "Pa",
}


@dataclass(frozen=True, kw_only=True)
class LawFit:
    """All stages; `hardening` is None where only elasticity and yield were asked for."""

    elastic: ElasticFit
    elastic_other: ElasticFit  # with the other choice of strain ("own" for "shared" and the reverse)
    yielding: YieldFit
    hardening: HardeningFit | None
    strength: dict[str, float]  # "q@<axial shortening>@<pressure>" [Pa], first leg

    @property
    def parameters(self) -> LawParameters:
        """The law: the joint values (where H_k and H_i are not separable, all of H_eff is carried by H_k)."""
        if self.hardening is None:
            raise ValueError("this fit stopped before the hardening")
        return self.hardening.joint.parameters


def strength(tests: Sequence[Curves], options: IdentifyOptions) -> dict[str, float]:
    """q [Pa] at stated axial shortenings on the first leg, by linear interpolation, mean over the tests of a pressure."""
    out: dict[str, float] = {}
    for level, group in by_pressure(tests).items():
        for strain in options.strength_strains:
            values = []
            for test in group:
                first = test.leg == 0
                shortening = -(test.axial_strain[first] - test.axial_strain[0])
                if shortening.max() >= strain * 0.999:
                    values.append(float(np.interp(strain, shortening, test.q[first])))
            if values:
                out[f"q@{strain:g}@{level:g}"] = float(np.mean(values))
    return out


def fit_law(
    tests: Sequence[Curves],
    options: IdentifyOptions,
    simulate: Simulate,
    *,
    start: LawFit | None = None,
    hardening: bool = True,
) -> LawFit:
    """The stages over tests of one or several samples. Errors as of the stages."""
    elastic = elastic_moduli(tests, options)
    other = elastic_moduli(tests, options, strain="own" if options.strain == "shared" else "shared")
    yielding = fit_yield(tests, elastic.E_s, elastic.nu, options)
    hard = None
    if hardening:
        near = start.hardening if start is not None else None
        hard = fit_hardening(tests, elastic, yielding, options, simulate, start=near)
    return LawFit(
        elastic=elastic, elastic_other=other, yielding=yielding, hardening=hard, strength=strength(tests, options)
    )


def scalars(fit: LawFit) -> dict[str, float]:
    """Every number that gets an interval, by name ("tau_y@50000" is at that confining pressure); nan: not separable."""
    e, y = fit.elastic, fit.yielding
    out = {"nu": e.nu, "E_s": e.E_s, "E_w": e.E_w, "E_w_bilateral": e.E_w_bilateral}
    out |= {"theta_f_staged": y.theta_f, "C_0_staged": y.C_0, "H_eff_staged": y.H_eff}
    if fit.hardening is not None:
        for suffix, stage in (("_staged", fit.hardening.staged), ("", fit.hardening.joint)):
            values = stage.parameters
            out[f"H_k{suffix}"] = values.H_k if stage.separable else float("nan")
            out[f"H_i{suffix}"] = values.H_i if stage.separable else float("nan")
        joint = fit.hardening.joint
        out |= {"theta_f": joint.parameters.theta_f, "C_0": joint.parameters.C_0, "H_eff": joint.H_eff}
    if y.own_least_squares is not None and y.study_least_absolute is not None:
        out |= {"theta_f_own": y.own_least_squares.angle, "C_0_own": y.own_least_squares.C_0}
        out |= {"theta_f_study": y.study_least_absolute.angle, "C_0_study": y.study_least_absolute.C_0}
    out |= {f"E_s@{level:g}": value for level, value in e.E_s_by_pressure.items()}
    out |= {f"E_w@{level:g}": value for level, value in e.E_w_by_pressure.items()}
    out |= {f"tau_y@{level:g}": value for level, value in y.tau_y.items()}
    return out | fit.strength
