"""What came out, in plain sentences, the least flattering first: they open the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError

if TYPE_CHECKING:
    from .identification import Identification

__all__ = ["GOOD", "POOR", "findings"]

GOOD = 0.05  # error of q below which the replay is called close
POOR = 0.15  # above which it is called bad


def _verdict(error: float) -> str:
    return "closely" if error < GOOD else "roughly" if error < POOR else "BADLY"


def _kilo(pascal: float) -> str:
    """A stress in kPa; what is below one Pa is none."""
    return f"{pascal / 1e3:.3g}" if pascal >= 1.0 else "0"


def _replay(found: Identification) -> list[str]:
    linked = [p for p in found.predictions if p.linked]
    fitted = [p for p in linked if not p.held_out]
    held = [p for p in linked if p.held_out]
    worst = max(fitted, key=lambda p: p.error_q)
    out = [
        f"The law replays the deviator stress q = σ_r − σ_z of the fitted tests {_verdict(worst.error_q)}: rms error "
        f"{np.mean([p.error_q for p in fitted]):.1%} of max|q| on average, {worst.error_q:.1%} at worst "
        f"({worst.pressure / 1e3:g} kPa, seed {worst.seed})."
    ]
    if held:
        worst = max(held, key=lambda p: p.error_q)
        out.append(
            f"It predicts the held-out pressure{'s' if len(found.held_out) > 1 else ''} "
            f"{', '.join(f'{level / 1e3:g}' for level in found.held_out)} kPa {_verdict(worst.error_q)}: "
            f"{np.mean([p.error_q for p in held]):.1%} on average, {worst.error_q:.1%} at worst{_between(found)}."
        )
    else:
        out.append("No pressure was held out: nothing here tests the law on data it has not seen.")
    side = float(np.mean([p.error_lateral for p in linked]))
    data = float(np.mean([p.volume_end for p in linked]))
    model = float(np.mean([p.volume_end_law for p in linked]))
    last = [(float(p.volume_strain[-1]), float(p.volume_strain_law[-1])) for p in linked]
    end, end_law = np.mean(last, axis=0)
    text = (
        f"The lateral strain, which is not fitted, is off by {side:.1%} of its maximum (rms); volume strain at the end of the "
        f"first leg: grains {data:+.2%}, law {model:+.2%}; at the end of the path: grains {end:+.2%}, law {end_law:+.2%}"
    )
    opposite = data < 0.0 < model
    out.append(
        text
        + (" — the wrong sign: associated flow dilates from first yield, the grains contract." if opposite else ".")
    )
    return out


def _between(found: Identification) -> str:
    """Says whether the held-out pressures are interpolated."""
    inside = all(min(found.fitted) < level < max(found.fitted) for level in found.held_out)
    return " (it lies between the fitted ones)" if inside else " (beyond the fitted ones)"


def _yield(found: Identification) -> list[str]:
    """What the joint fit made of friction and cohesion, where it cannot be taken at its word."""
    out = []
    hard = found.pooled.hardening
    if hard is not None and not hard.yield_separable:
        return [
            f"θ_f, C_0 and H_eff are not separable by these tests (condition number {hard.yield_condition:.2g}): none has an interval. "
            "Test at pressures that lie farther apart, or reverse the strain until plastic flow in extension resumes."
        ]
    theta, cohesion = found.estimates.get("theta_f"), found.estimates.get("C_0")
    if theta is not None and theta.low is not None and theta.low <= 0.0 < theta.value:
        out.append(
            f"θ_f = {theta.value:.3f} rad of the joint fit is not clear of zero (interval up to {theta.high:.3f} rad)."
        )
    if cohesion is not None and cohesion.value > 0.0:
        out.append(
            f"C_0 = {cohesion.value / 1e3:.3g} kPa is no cohesion of the grains (those of fenchel have none): it is where the straight "
            "line of the law through a curved onset of yield meets zero pressure."
        )
    return out


def friction_words(theta_f: float, C_0: float) -> list[str]:
    """What friction angle and cohesion of a cone are in the words of a triaxial test; nothing for a cone that is too steep for one."""
    from fenchel.potentials.library import triaxial_friction

    try:
        read = triaxial_friction(theta_f, C_0)
    except InputError:
        return []
    return [
        f"First yield of the law in triaxial compression is that of Mohr–Coulomb with φ′ = {np.degrees(read['phi']):.1f}° and "
        f"c′ = {_kilo(read['c'])} kPa; θ_f = {np.degrees(theta_f):.1f}° is the slope of √J₂ over the mean pressure, another angle."
    ]


def _hardening(found: Identification) -> list[str]:
    hard = found.pooled.hardening
    assert hard is not None
    limit = found.options.condition_limit
    if not hard.separable and not hard.yield_separable:
        return [f"Nor are H_k and H_i (condition number {hard.joint.condition:.2g} > {limit:g})."]
    if not hard.separable:
        return [
            f"H_k and H_i are not separable by these tests (condition number {hard.joint.condition:.2g} > {limit:g}): only "
            f"H_eff = {hard.joint.H_eff / 1e3:.4g} kPa is identified. Reverse the strain until plastic flow in extension "
            "resumes."
        ]
    out = [f"H_k and H_i are separable: condition number {hard.joint.condition:.2g} (limit {limit:g})."]
    out += [f"{name} came out at its lower bound: the data want less than none of it." for name in hard.joint.at_bound]
    staged, joint = hard.staged, hard.joint
    out.append(
        f"Misfit of q: {staged.misfit:.1%} with the staged values, {joint.misfit:.1%} after the joint refinement."
    )
    free = hard.free_stiffness
    if free is not None and free.misfit < 0.85 * joint.misfit:
        out.append(
            f"With E_s free too the misfit falls to {free.misfit:.1%} at E_s = {free.parameters.E_s / 1e6:.3g} MPa (small strain: "
            f"{joint.parameters.E_s / 1e6:.3g} MPa): the grains soften before they yield, the law does not."
        )
    shift = abs(joint.parameters.theta_f - staged.parameters.theta_f) / max(staged.parameters.theta_f, 1e-3)
    if shift > 0.2:
        first, whole = staged.parameters, joint.parameters
        out.append(
            f"Yield read from the first leg (θ_f = {first.theta_f:.3f} rad, C_0 = {_kilo(first.C_0)} kPa) and from the "
            f"whole path ({whole.theta_f:.3f} rad, {_kilo(whole.C_0)} kPa) disagree: one linearly hardening surface "
            "does not follow both."
        )
    return out


def _elastic(found: Identification) -> list[str]:
    e = found.pooled.elastic
    out = []
    if e.nu_at_bound:
        out.append(f"The common Poisson ratio sits at the end of its range, ν = {e.nu:.3g}.")
    if e.E_w > 0.0:
        out.append(
            f"E_w/E_s = {e.E_w / e.E_s:.2%}; the unilateral wire leaves {e.misfit_wire:.0%} (rms) of the link stress in "
            f"its window unexplained (bilateral: {e.misfit_wire_bilateral:.0%})."
        )
    if abs(e.nu - e.nu_sand_alone) > 0.03:
        out.append(f"One ν for both phases costs: {e.nu:.3f} in common, {e.nu_sand_alone:.3f} for the sand alone.")
    return out


def _wires(found: Identification) -> list[str]:
    e = found.pooled.elastic
    if found.control is None and e.E_w == 0.0 and e.misfit_wire == 0.0:
        return ["No link carries stress: this is sand alone."]
    if found.control is None:
        return ["There is no unlinked control: what the beads do cannot be told from what the wires do."]
    c, out = found.control, []
    out.append(
        "The control carries no link stress."
        if c.wire_stress_max == 0.0
        else f"The control carries link stress up to {c.wire_stress_max:.3g} Pa: it is not unlinked."
    )

    # the sphere strains less than the box: the largest strain that every sample reached at every pressure
    def whole(strain: float) -> bool:
        found_there = [c.difference.get(f"q@{strain:g}@{level:g}") for level in found.fitted]
        return all(d is not None and np.all(np.isfinite(d.seed_values)) for d in found_there)

    strain = max((x for x in found.options.strength_strains if whole(x)), default=0.0)
    marked = [c.difference[k] for k in c.difference if k.startswith(f"q@{strain:g}@")]
    parts = [
        f"{d.value / 1e3:+.2f} ({d.low / 1e3:+.2f} to {d.high / 1e3:+.2f}) at {float(d.name.split('@')[2]) / 1e3:g} kPa"
        for d in marked
    ]
    if parts:
        clear = sum(d.low > 0.0 or d.high < 0.0 for d in marked)
        out.append(
            f"Links change q at {strain:.2%} shortening by {'; '.join(parts)} [kPa]: "
            f"clear of zero at {clear} of {len(marked)} pressures."
        )
    return out


def findings(found: Identification) -> tuple[str, ...]:
    """Sentences for the head of the report."""
    hard = found.pooled.hardening
    usual = friction_words(hard.joint.parameters.theta_f, hard.joint.parameters.C_0) if hard is not None else []
    out = [*_replay(found), *_yield(found), *usual, *_hardening(found), *_elastic(found), *_wires(found)]
    ends = [m for m in found.mismatches if m.linked and np.isfinite(m.end_of_first_leg)]
    if ends:
        value = float(np.mean([m.end_of_first_leg for m in ends]))
        band = float(np.mean([m.end_deviation for m in ends]))
        note = f" (octant deviation {band:.3f})" if np.isfinite(band) else ""
        out.append(
            f"Strains of the phases differ by ‖ε_s − ε_w‖/‖ε_s‖ = {value:.3f} at the end of the first "
            f"leg{note}; the law has one strain."
        )
    sources = {e.source for e in found.estimates.values()}
    if sources == {"none"}:
        out.append("One sample and no octant sums: the values stand without intervals.")
    elif len(found.seeds) == 1:
        out.append("One sample: the intervals come from leaving octants out, not from another sample.")
    if found.failed_replicas:
        out.append(f"{found.failed_replicas} octant replicas did not converge and are left out of the spread.")
    return tuple(out)
