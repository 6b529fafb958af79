"""The identified law as files: `law.py` for `fenchel drive`, with a path and a parameter file per pressure.

In a test the wires are natural at the confining pressure P_0, not in the virgin state. In the file this is a shift of the
strain that they see: e = ε + P_0/(3 K_s) I, zero in the state of isotropic compression, K_s = E_s/(3(1 − 2ν)). A path starts in
the virgin state, goes to the isotropic pressure in one (elastic) step and then shortens; the fictitious tension of the wires
below P_0 is gone there.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .identification import Identification
from .parameters import LawParameters

__all__ = ["law_text", "parameters_text", "path_rows", "write_law"]

_NOTES = {
    "E_s": ("Pa", "Young's modulus of the sand"),
    "E_w": ("Pa", "Young's modulus of the wires, in extension only"),
    "nu": ("1", "Poisson ratio of both"),
    "theta_f": ("rad", "friction angle, sqrt(J2) = C_0 + P tan(theta_f)"),
    "C_0": ("Pa", "cohesion"),
    "H_k": ("Pa", "kinematic hardening"),
    "H_i": ("Pa", "isotropic hardening"),
}

_BODY = """
eps, eps_p, alpha, p = sym_tensor("eps"), sym_tensor("eps_p"), sym_tensor("alpha"), scalar("p")

lambda_w, mu_w = lame(E_w, nu)
stretch = eps + P_0 * (1 - 2 * nu) / E_s * identity  # P_0/(3 K_s): zero when isotropically compressed to P_0
sand = isotropic(E_s, nu).energy(eps - eps_p) + H_k / 2 * inner(alpha, alpha) + H_i / 2 * p**2
wire = lambda_w / 2 * pos(tr(stretch)) ** 2 + mu_w * inner(pos(stretch), pos(stretch))
A, chi, R = forces(eps_p, alpha, p)
f = norm(dev(A + chi)) / sqrt(2) + tan(theta_f) / 3 * tr(A + chi) + R - C_0

law = Law("identified", psi=sand + wire, phi_star=indicator(f), observable=eps, internal=(eps_p, alpha, p))
"""

_HEAD = '''"""Law identified from {tests}.

{findings}

Drive it:  fenchel drive law.py:law path_{first}kPa.csv --parameters parameters_{first}kPa.toml

P_0 is the pressure of the sphere at which the wires were switched on (natural there); 0 for wires natural in the virgin state.
"""

from sympy import sqrt, tan

from fenchel.potentials import (
    Law,
    dev,
    forces,
    identity,
    indicator,
    inner,
    isotropic,
    lame,
    norm,
    parameter,
    pos,
    scalar,
    sym_tensor,
    tr,
)

'''


def _interval(found: Identification, name: str) -> str:
    e = found.estimates[name]
    if not np.isfinite(e.value):
        return f"{e.note}: carries what is left of H_eff = {found.estimates['H_eff'].value:.6g} Pa"
    if not np.isfinite(e.low):
        return e.note or "no interval"
    text = f"{found.options.confidence:.0%} interval for another sample {e.low:.4g} to {e.high:.4g} ({e.source})"
    return f"{text}; {e.note}" if e.note else text


def law_text(found: Identification) -> str:
    """Source of `law.py`: the declaration, with the identified values as defaults and their intervals as comments."""
    levels, seeds = ", ".join(f"{level / 1e3:g}" for level in found.fitted), ", ".join(map(str, found.seeds))
    tests = f"triaxial tests at {levels} kPa, seeds {seeds}"
    lines = []
    values = found.law.to_json()
    for name, (unit, note) in _NOTES.items():
        bounds = {"nu": "lower=-1, upper=0.5", "theta_f": "lower=0, upper=1.57"}.get(name, "lower=0")
        lines.append(f"# {_interval(found, name)}")
        lines.append(f'{name} = parameter("{name}", {bounds}, unit="{unit}", default={values[name]!r}, note="{note}")')
    lines.append(
        'P_0 = parameter("P_0", lower=0, unit="Pa", default=0.0, note="pressure at which the wires are natural")'
    )
    sentences = "\n".join(f"* {text}" for text in found.findings[:3])
    head = _HEAD.format(tests=tests, findings=sentences, first=f"{found.fitted[0] / 1e3:g}")
    return head + "\n".join(lines) + "\n" + _BODY


def parameters_text(parameters: LawParameters, pressure: float) -> str:
    """Parameter file (TOML) of `law.py` for a test that starts at one pressure of the sphere [Pa]."""
    rows = [f"{name} = {value!r}  # {_NOTES[name][0]}" for name, value in parameters.to_json().items()]
    return "\n".join([*rows, f"P_0 = {float(pressure)!r}  # Pa, wires natural at this pressure"]) + "\n"


def path_rows(parameters: LawParameters, pressure: np.ndarray, axial_strain: np.ndarray) -> str:
    """Path file (CSV) from the virgin state: isotropic compression to the first of `pressure`, shape (n,), then the test.

    `pressure` [Pa] is the lateral pressure of the sphere at every frame, `axial_strain` its axial strain from the start of the test.
    """
    start = pressure[0] / (3.0 * parameters.bulk)
    rows = ["t,eps_zz,sig_xx,sig_yy", "0,0,0,0"]
    for k, (strain, side) in enumerate(zip(axial_strain - axial_strain[0], pressure, strict=True)):
        rows.append(f"{k + 1},{strain - start:.12e},{-side:.9e},{-side:.9e}")
    return "\n".join(rows) + "\n"


def write_law(found: Identification, directory: Path) -> list[Path]:
    """Write `law.py`, `path_<P>kPa.csv` and `parameters_<P>kPa.toml` (first sample at each pressure); returns the paths."""
    out = {directory / "law.py": law_text(found)}
    for level in (*found.fitted, *found.held_out):
        test = next((p for p in found.predictions if p.linked and p.pressure == level), None)
        if test is None:
            continue
        tag = f"{level / 1e3:g}kPa"
        out[directory / f"path_{tag}.csv"] = path_rows(found.law, test.lateral_pressure, test.axial_strain)
        out[directory / f"parameters_{tag}.toml"] = parameters_text(found.law, float(test.lateral_pressure[0]))
    for path, text in out.items():
        path.write_text(text, encoding="utf-8")
    return list(out)
