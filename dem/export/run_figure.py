r"""What a run looks like: the sample as it is at the end, and what was measured on the way.

A test shows the equivalent stress √J₂ = ‖dev σ‖/√2 of the walls against the axial strain and against the mean pressure p = −tr σ/3, the
volume strain, and √J₂ by phase; a motion its energies and its residual against time; a deposit its free surface. A run that is not
finished, and a state by itself, show the sample alone.

The colours are those of Okabe and Ito, which read with colour-blind eyes; no curve is told by its colour alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...drawing import INK, LOOKS, WALKED, Signs, shown, styled, unit_scale, walked
from ..measures import Network, active_length, permutation_test
from ..record import TriaxialRecord
from .sample_panel import FLAT, draw_sample, seen_shape

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["motion_figure", "sample_figure", "slope_figure", "triaxial_figure"]

Array = NDArray[np.float64]


def _canvas(network: Network, rows: int, columns: int, options: dict[str, Any]) -> tuple[Figure, list[Any]]:
    """A figure with the sample on the left and `rows` × `columns` panels beside it; without panels the sample alone."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2 + 3.6 * columns, max(2.9 * rows, 4.2)), layout="constrained")
    if not columns:
        draw_sample(figure, figure.subplots(), network, **options)
        return figure, []
    shape = seen_shape(network, options["view"])
    if shape < FLAT:  # what lies flat has its panels below it, in one row
        high, low = 8.0 * shape + 1.6, 3.0
        figure = Figure(figsize=(8.0, high + low), layout="constrained")
        parts: Any = figure.subfigures(2, 1, height_ratios=(high, low))
        rows, columns = 1, rows * columns
    else:
        parts = figure.subfigures(1, 2, width_ratios=(5.2, 3.6 * columns))
    first, second = parts
    draw_sample(first, first.subplots(), network, **options)
    return figure, list(second.subplots(rows, columns, squeeze=False).ravel())


def _legend_above(panel: Any, columns: int) -> None:
    """The legend above a panel, where it covers no curve."""
    panel.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns, columnspacing=1.2, handlelength=2.4)


def _equivalent(stress: Array) -> Array:
    """√J₂ [Pa] of stresses in Mandel components, shape (frame_count, 6)."""
    deviator = stress.copy()
    deviator[:, :3] -= stress[:, :3].mean(axis=1, keepdims=True)
    return np.linalg.norm(deviator, axis=1) / np.sqrt(2.0)


def _legs(record: TriaxialRecord) -> list[tuple[str, slice]]:
    """Name and frames of every leg, the last frame of the one before it first, so that curves hang together."""
    found: list[tuple[str, slice]] = []
    for k in range(int(record.leg.max()) + 1):
        frames = np.flatnonzero(record.leg == k)
        start, stop = max(int(frames[0]) - (k > 0), 0), int(frames[-1]) + 1
        strain = record.axial_strain[start:stop]
        found.append((f"leg {k + 1}: {'shortening' if strain[-1] < strain[0] else 'extension'}", slice(start, stop)))
    return found


@styled
def triaxial_figure(network: Network, record: TriaxialRecord, title: str, signs: str, **sample: Any) -> Figure:
    """A finished test: sample, √J₂ against strain, √J₂ against p, volume strain, √J₂ by phase (sliding without wires)."""
    turned = Signs(signs)
    figure, (stress, path, volume, phases) = _canvas(network, 2, 2, sample)
    axial = turned.percent(record.axial_strain)
    equivalent, p = _equivalent(record.wall_stress) / 1e3, -record.wall_stress[:, :3].mean(axis=1) / 1e3
    dilation = turned.percent(record.wall_strain[:, :3].sum(axis=1))
    for k, (name, frames) in enumerate(_legs(record)):
        look = LOOKS[k % len(LOOKS)]
        stress.plot(axial[frames], equivalent[frames], label=name, **look)
        path.plot(p[frames], equivalent[frames], **look)
        volume.plot(axial[frames], dilation[frames], **look)
    stress.set(xlabel=turned.axial, ylabel=r"equivalent stress $\sqrt{J_2}$ [kPa]")
    if len(stress.lines) > 1:
        legs = stress.get_legend_handles_labels()
        stress.figure.legend(*legs, loc="outside upper center", ncols=5)
    path.set(xlabel=r"mean pressure $p=-\mathrm{tr}\,\sigma/3$ [kPa]", ylabel=r"equivalent stress $\sqrt{J_2}$ [kPa]")
    volume.set(xlabel=turned.axial, ylabel=turned.volume)
    length = walked(record.axial_strain)
    if len(record.bead_moment) and record.bead_moment.any():
        history = record.history()
        parts = [("grains", history.stress_grains), ("beads", history.stress_beads)]
        parts += [("wires", history.stress_links)] if record.linked else []
        for look, (name, value) in zip(LOOKS, parts, strict=False):
            phases.plot(length, _equivalent(value) / 1e3, label=name, **look)
        phases.set(xlabel=WALKED, ylabel=r"$\sqrt{J_2}$ of a phase [kPa]")
        _legend_above(phases, 3)
    elif "sliding" in record.series:
        phases.plot(length, 100.0 * record.series["sliding"], **LOOKS[0])
        phases.set(xlabel=WALKED, ylabel="contacts that slide [%]")
    else:
        phases.set_visible(False)
    figure.suptitle(f"{title}: confining pressure {record.pressure / 1e3:g} kPa{_active(network)}", fontsize=10)
    return shown(figure)


def _active(network: Network) -> str:
    """The active length of the last state, beside the one that shuffled tensions would have."""
    if not len(network.link) or not (network.tension > 0.0).any():
        return ""
    found = active_length(network)
    chance = permutation_test(network, np.random.default_rng(0), samples=199).null_mean
    scale, unit = unit_scale(found.length, "m") if found.length > 0.0 else (1e3, "mm")
    return f"; active length {scale * found.length:.3g} {unit} ({found.radii:.3g} mean radii), by chance {scale * chance:.3g} {unit}"


@styled
def motion_figure(network: Network, content: dict[str, Any], title: str, **sample: Any) -> Figure:
    """A finished motion: sample, energies and residual against time."""
    figure, (energy, residual) = _canvas(network, 2, 1, sample)
    frames = content["frames"]
    names = {
        "kinetic": "kinetic",
        "elastic": "elastic",
        "friction": "lost in friction",
        "shock": "lost in shocks",
        "external": "work of weight and drives",
    }
    kept = {name: np.asarray(frames[name]) for name in names if name in frames}
    top = max((float(np.nanmax(np.abs(v), initial=0.0)) for v in kept.values()), default=0.0)
    scale, unit = unit_scale(top, "J") if top > 0.0 else (1.0, "J")
    for look, (name, value) in zip(LOOKS, kept.items(), strict=False):
        energy.plot(frames["time"], scale * value, label=names[name], **look)
    energy.set(xlabel="time [s]", ylabel=f"energy [{unit}]")
    _legend_above(energy, 2)
    value = np.asarray(frames["natural_map"], dtype=float)
    residual.plot(frames["time"], np.where(value > 0.0, value, np.nan), color=INK)
    if (value > 0.0).any():
        residual.set_yscale("log")
    residual.set(xlabel="time [s]", ylabel="residual of a step [–]\n(natural map)")
    figure.suptitle(title, fontsize=10)
    return shown(figure)


@styled
def slope_figure(network: Network, content: dict[str, Any], title: str, **sample: Any) -> Figure:
    """A finished deposit: sample, and the mean free surface with the angle of repose."""
    figure, (surface,) = _canvas(network, 1, 1, sample)
    profile, quality = content["profile"], content["quality"]
    size = max(float(np.max(profile["distance"], initial=0.0)), 1e-9)
    scale, unit = unit_scale(size, "m")
    surface.plot(scale * profile["distance"], scale * profile["height"], **LOOKS[0])
    surface.set(xlabel=f"distance from the axis [{unit}]", ylabel=f"height of the free surface [{unit}]")
    surface.set_ylim(bottom=0.0)
    said = "too few bodies on the surface for a slope"
    if np.isfinite(quality["angle"]):
        said = f"angle of repose {quality['angle']:.1f}° ({quality['angle_low']:.1f}° to {quality['angle_high']:.1f}°)"
    figure.suptitle(f"{title}: {said}", fontsize=10)
    return shown(figure)


@styled
def sample_figure(network: Network, title: str, **sample: Any) -> Figure:
    """The sample alone."""
    figure, _ = _canvas(network, 1, 0, sample)
    figure.suptitle(title, fontsize=10)
    return shown(figure)
