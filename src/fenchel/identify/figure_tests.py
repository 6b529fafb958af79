"""The tests and their replay: q, volume, phases, wires, mismatch of the phase strains."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np

from ..drawing import FAINT, INK, WALKED, Signs, canvas, colours, legend_below, styled, walked
from .identification import Identification
from .prediction import Prediction

__all__ = ["fit_figure", "mismatch_figure", "phase_figure", "strain_figure", "stress_figure", "wire_figure"]


def _levels(found: Identification) -> list[float]:
    return sorted({*found.fitted, *found.held_out})


def _of(found: Identification, level: float, linked: bool) -> list[Prediction]:
    return [p for p in found.predictions if p.pressure == level and p.linked == linked]


def _panels(found: Identification) -> tuple[Any, dict[float, Any]]:
    levels = _levels(found)
    columns = min(2, len(levels))
    figure, axes = canvas(ceil(len(levels) / columns), columns, sharex=True)
    flat = list(axes.flat)
    for spare in flat[len(levels) :]:
        spare.set_visible(False)
    for axis, level in zip(flat, levels, strict=False):
        held = " — held out" if level in found.held_out else ""
        axis.set_title(f"P = {level / 1e3:g} kPa{held}")
        axis.axhline(0.0, color=FAINT, linewidth=0.5)
    for axis in axes[-1]:
        axis.xaxis.set_tick_params(labelbottom=True)
    return figure, dict(zip(levels, flat, strict=False))


def _below(figure: Any, entries: Sequence[tuple[str, dict[str, Any]]]) -> None:
    from matplotlib.lines import Line2D

    legend_below(figure, [Line2D([], [], **style) for _, style in entries], [name for name, _ in entries])


def _tests(found: Identification, signs: Signs, value: Any, label: str) -> Any:
    figure, panels = _panels(found)
    tints = colours(_levels(found))
    for level, axis in panels.items():
        for linked, style in ((False, "--"), (True, "-")):
            for k, p in enumerate(_of(found, level, linked)):
                colour = FAINT if not linked else tints[level]
                axis.plot(signs.percent(p.axial_strain), value(p), style, color=colour, alpha=1.0 if k == 0 else 0.4)
        axis.set(xlabel=signs.axial, ylabel=label)
    entries: list[tuple[str, dict[str, Any]]] = [("links on", {"color": INK})]
    if found.control is not None:
        entries.append(("control, beads unlinked", {"color": FAINT, "linestyle": "--"}))
    if len(found.seeds) > 1:
        entries.append((f"further seeds ({len(found.seeds) - 1})", {"color": INK, "alpha": 0.4}))
    _below(figure, entries)
    return figure


@styled
def stress_figure(found: Identification, signs: Signs) -> Any:
    """q = σ_r − σ_z of the whole against the axial strain, per pressure; positive when the sample is pressed axially."""
    return _tests(found, signs, lambda p: p.q / 1e3, r"$q=\sigma_r-\sigma_z$ [kPa]")


@styled
def strain_figure(found: Identification, signs: Signs) -> Any:
    """Volume strain of the sand against the axial strain, with that of the law."""
    figure, panels = _panels(found)
    tints = colours(_levels(found))
    for level, axis in panels.items():
        for linked, style in ((False, "--"), (True, "-")):
            for k, p in enumerate(_of(found, level, linked)):
                colour = FAINT if not linked else tints[level]
                x = signs.percent(p.axial_strain)
                axis.plot(x, signs.percent(p.volume_strain), style, color=colour, alpha=1.0 if k == 0 else 0.4)
                if linked and k == 0:
                    axis.plot(x, signs.percent(p.volume_strain_law), ":", color=INK)
        axis.set(xlabel=signs.axial, ylabel=signs.volume)
    entries: list[tuple[str, dict[str, Any]]] = [
        ("grains, links on", {"color": INK}),
        ("law", {"color": INK, "linestyle": ":"}),
    ]
    if found.control is not None:
        entries.insert(1, ("grains, beads unlinked", {"color": FAINT, "linestyle": "--"}))
    _below(figure, entries)
    return figure


@styled
def fit_figure(found: Identification, signs: Signs) -> Any:
    """q measured (colour) and replayed by the law (black), fitted and held-out pressures."""
    figure, panels = _panels(found)
    tints = colours(_levels(found))
    for level, axis in panels.items():
        tests = _of(found, level, True)
        for k, p in enumerate(tests):
            axis.plot(signs.percent(p.axial_strain), p.q / 1e3, color=tints[level], alpha=1.0 if k == 0 else 0.4)
        if tests:
            first = tests[0]
            axis.plot(signs.percent(first.axial_strain), first.q_law / 1e3, "--", color=INK, linewidth=1.0)
            errors = ", ".join(f"{p.error_q:.1%}" for p in tests)
            axis.set_title(f"{axis.get_title(loc='left')}; error {errors}")
        axis.set(xlabel=signs.axial, ylabel=r"$q=\sigma_r-\sigma_z$ [kPa]")
    _below(
        figure,
        [
            ("grains and wires", {"color": INK, "alpha": 0.6}),
            ("law", {"color": INK, "linestyle": "--", "linewidth": 1.0}),
        ],
    )
    return figure


@styled
def phase_figure(found: Identification, signs: Signs) -> Any:
    """First sample: ±√J₂ = q/√3 of the sand (left) and lateral stress of the wires (right), all pressures; control dashed."""
    figure, axes = canvas(1, 2, height=3.2)
    tints = colours(_levels(found))
    for level in _levels(found):
        for linked, style in ((False, "--"), (True, "-")):
            for p in _of(found, level, linked)[:1]:
                x = signs.percent(p.axial_strain)
                axes[0, 0].plot(
                    x, p.q_sand / np.sqrt(3.0) / 1e3, style, color=tints[level], alpha=1.0 if linked else 0.5
                )
                axes[0, 1].plot(x, p.wire, style, color=tints[level], alpha=1.0 if linked else 0.5)
    axes[0, 0].set(xlabel=signs.axial, ylabel=r"sand $\pm\sqrt{J_2}=q_s/\sqrt{3}$ [kPa]", title="sand")
    axes[0, 1].set(
        xlabel=signs.axial,
        ylabel=r"wire stress $\sigma_{w,r}$ [Pa] (tension +)",
        title="wires, lateral, less the start",
    )
    entries = [(f"{level / 1e3:g} kPa", {"color": tints[level]}) for level in _levels(found)]
    _below(figure, [*entries, ("beads unlinked", {"color": INK, "linestyle": "--", "alpha": 0.5})])
    return figure


@styled
def wire_figure(found: Identification, signs: Signs) -> Any:
    """Lateral wire stress against the lateral strain of the first leg, with the unilateral law."""
    figure, axes = canvas(1, 1, height=3.2)
    axis, tints = axes[0, 0], colours(_levels(found))
    for level in _levels(found):
        for k, p in enumerate(_of(found, level, True)):
            first = p.leg == 0
            axis.plot(
                signs.percent(p.lateral_strain[first]), p.wire[first], color=tints[level], alpha=1.0 if k == 0 else 0.4
            )
            if k == 0:
                axis.plot(
                    signs.percent(p.lateral_strain_law[first]),
                    p.wire_law[first],
                    "--",
                    color=tints[level],
                    linewidth=0.9,
                )
    axis.set(
        xlabel=signs.lateral, ylabel=r"wire stress $\sigma_{w,r}$ [Pa] (tension +)", title="wires on the first leg"
    )
    entries = [(f"{level / 1e3:g} kPa", {"color": tints[level]}) for level in _levels(found)]
    _below(figure, [*entries, ("law", {"color": INK, "linestyle": "--", "linewidth": 0.9})])
    return figure


@styled
def mismatch_figure(found: Identification, signs: Signs) -> Any:
    """‖ε_s − ε_w‖/‖ε_s‖ along the test with its octant band (first sample); controls dashed."""
    figure, axes = canvas(1, 1, height=3.0)
    axis, tints = axes[0, 0], colours(_levels(found))
    seed = found.seeds[0]
    for m in found.mismatches:
        if m.seed != seed:
            continue
        x = walked(m.axial_strain)
        axis.plot(
            x,
            m.value,
            "-" if m.linked else "--",
            color=tints[m.pressure],
            alpha=1.0 if m.linked else 0.4,
            linewidth=1.0,
        )
        if m.linked and np.isfinite(m.deviation).any():
            axis.fill_between(
                x,
                np.maximum(m.value - m.deviation, 0.0),
                m.value + m.deviation,
                color=tints[m.pressure],
                alpha=0.15,
                lw=0,
            )
    axis.set(xlabel=WALKED, ylabel=r"$\|\varepsilon_s-\varepsilon_w\|/\|\varepsilon_s\|$ [-]")
    axis.set_ylim(bottom=0.0)
    axis.set_title(f"seed {seed}; band: one octant deviation; gaps: strain too small")
    entries = [(f"{level / 1e3:g} kPa", {"color": tints[level]}) for level in _levels(found)]
    _below(figure, [*entries, ("beads unlinked", {"color": INK, "linestyle": "--", "alpha": 0.4})])
    return figure
