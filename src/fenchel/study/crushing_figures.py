"""Pictures of the crushing test: maps of the wires on the half section, wire pressure over the shortening, force over the mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..drawing import FAINT, INK, canvas, legend_below, styled
from .cyclic_figures import MARKS, SHADES
from .models import MODELS

__all__ = ["map_figure", "mesh_figure", "sign_figure"]

Array = NDArray[np.float64]

TITLES = {"pressure": "wire pressure [Pa]", "equivalent": r"wire stress $\sqrt{J_2}$ [Pa]"}


@styled
def map_figure(sets: Mapping[str, Mapping[str, Mapping[str, Array]]], key: str, *, own_scale: bool = False) -> Any:
    """Half sections r–z of the models side by side, one colour scale per set of parameters; with `own_scale` every map over its largest
    value, sand left out."""
    names = [m for m in MODELS if not (own_scale and m == "sand")]
    figure, axes = canvas(1, len(names) * len(sets), height=4.1, sharey=True)
    groups = np.split(axes[0], len(sets))
    for group, (title, models) in zip(groups, sets.items(), strict=True):
        image = None
        most = {m: float(np.abs(models[m][key]).max()) for m in names}
        whole = 1.0 if own_scale else max(most.values())
        scale = {
            "vmin": -whole if key == "pressure" else 0.0,
            "vmax": whole,
            "cmap": "RdBu_r" if key == "pressure" else "viridis",
        }
        for one, model in zip(group, names, strict=True):
            cells = models[model]
            image = _section(one, cells, cells[key] / (most[model] if own_scale else 1.0), **scale)
            one.set_title(model, loc="center", fontsize=8)
            if model == "sand":
                one.annotate(
                    "no wires",
                    (25.0, 100.0),
                    ha="center",
                    va="center",
                    rotation=90,
                    color=FAINT if key == "pressure" else "white",
                )
        group[len(names) // 2].set_xlabel("r [mm]", loc="center" if len(names) % 2 else "left")
        bar = figure.colorbar(image, ax=list(group), location="bottom", aspect=22, pad=0.02)
        bar.set_label(
            (TITLES[key].replace("[Pa]", "/ its largest value") if own_scale else TITLES[key]) + f"\n{title}",
            fontsize=8,
        )
    axes[0, 0].set(ylabel="z [mm]", yticks=np.arange(0, 201, 50))
    return figure


def _section(one: Any, cells: Mapping[str, Array], values: Array, **scale: Any) -> Any:
    order = np.lexsort((cells["r"], cells["z"]))
    r, z = (np.unique(np.round(1e3 * cells[c], 9)) for c in ("r", "z"))
    table = values[order].reshape(z.size, r.size)
    image = one.pcolormesh(_edges(r), _edges(z), table, shading="flat", rasterized=True, **scale)
    one.set_aspect("equal")
    one.grid(False)
    one.set_xticks([0, 50])
    return image


def _edges(middles: Array) -> Array:
    half = 0.5 * (middles[1] - middles[0])
    return np.concatenate([middles - half, middles[-1:] + half])


@styled
def sign_figure(sets: Mapping[str, Mapping[str, Any]], shapes: Sequence[float]) -> Any:
    """A panel per set of parameters: bands from the lowest to the highest wire pressure."""
    figure, axes = canvas(1, len(sets), height=2.7)
    shades = ("#D55E00", "#009E73", "#0072B2")
    handles: list[Any] = []
    for one, (title, found) in zip(axes[0], sets.items(), strict=True):
        x = 100.0 * found["shortening"]
        handles = []
        for shape, shade in zip(shapes, shades, strict=False):
            band = found[f"rough, {shape:g}"]
            handles.append(
                one.fill_between(x, band["lowest"] / 1e3, band["highest"] / 1e3, color=shade, alpha=0.22, linewidth=0)
            )
            one.plot(x, band["lowest"] / 1e3, color=shade, linewidth=1.0)
            one.plot(x, band["highest"] / 1e3, color=shade, linewidth=1.0)
        (smooth,) = one.plot(x, found["smooth"]["lowest"] / 1e3, color=INK, linestyle="--", linewidth=1.0)
        handles.append(smooth)
        one.axhline(0.0, color=INK, linewidth=0.8)
        one.axvline(0.1, color=FAINT, linestyle=":", linewidth=0.9)
        one.set_title(title.replace(", but ", ",\n").replace(" and ", "\n"), fontsize=8)
        one.set(xlabel="shortening [%]", xlim=(0.0, float(x[-1])))
    axes[0, 0].set(ylabel="wire pressure [kPa]")
    legend_below(figure, handles, [*(f"height/diameter {s:g}" for s in shapes), "smooth platens"], columns=4)
    return figure


@styled
def mesh_figure(columns: Array, excess: Mapping[tuple[str, str], Array]) -> Any:
    """Excess of the force [%] over the number of columns, solid: selective integration, dashed: full."""
    figure, axes = canvas(1, 1, height=3.0)
    one = axes[0, 0]
    for (model, integration), values in excess.items():
        one.loglog(
            columns, values, color=SHADES[model], marker=MARKS[model], markersize=4, linestyle="-" if integration == "selective" else "--",
            label=f"{model}, {integration} integration",
        )  # fmt: skip
    one.axvline(20, color=FAINT, linestyle=":", linewidth=0.9)
    one.set_xticks(columns, [f"{n}" for n in columns])
    one.set_yticks([0.1, 0.2, 0.5, 1.0], ["0.1", "0.2", "0.5", "1"])
    one.minorticks_off()
    one.set(xlabel="elements along the radius and along the height", ylabel="force above its limit [%]")
    one.legend(fontsize=7)
    return figure
