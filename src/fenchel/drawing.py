"""How every figure looks: restrained, readable on a phone, tension or compression positive (the ground floor: nothing of ours but errors).

The colours are those of Okabe and Ito (2008), told apart by readers of every kind of colour vision; where curves of one panel must be told
apart they differ in their dashes or markers too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial, wraps
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

__all__ = [
    "BLUE",
    "FAINT",
    "GREEN",
    "INK",
    "LOOKS",
    "MEASURES",
    "ORANGE",
    "PURPLE",
    "SIGNS",
    "SKY",
    "STYLE",
    "VERMILION",
    "WALKED",
    "Signs",
    "canvas",
    "colours",
    "legend_below",
    "picture",
    "shown",
    "styled",
    "unit_scale",
    "walked",
]

Array = NDArray[np.float64]
SIGNS = ("tension-positive", "compression-positive")
INK, FAINT = "#222222", "#8a8a8a"
BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00"
_PALETTE = (BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE)
# of curves in one panel: colour and dashes
LOOKS: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "linestyle": "-"},
    {"color": VERMILION, "linestyle": "--"},
    {"color": GREEN, "linestyle": "-."},
    {"color": PURPLE, "linestyle": ":"},
    {"color": INK, "linestyle": (0, (6, 1, 1, 1, 1, 1))},
)
# equivalent stresses: the factor on √J₂, and the label
MEASURES = {"sqrt_J2": (1.0, r"$\sqrt{J_2}$"), "q": (3.0**0.5, r"$q=\sqrt{3J_2}$")}
STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "xtick.color": INK,
    "ytick.color": INK,
    "figure.dpi": 100,
    "svg.fonttype": "path",
    "axes.titlepad": 4.0,
    "svg.hashsalt": "fenchel",
}


WALKED = "axial strain walked [%]"


def walked(axial_strain: Array) -> Array:
    """Length of the strain path up to each frame [%], shape (frame_count,): an abscissa that does not turn at a reversal."""
    steps = np.abs(np.diff(axial_strain))
    return 100.0 * np.concatenate([[0.0], np.cumsum(steps)])


@dataclass(frozen=True)
class Signs:
    """Sign convention of the axes: the factor on strains and direct stresses, and the words for the labels."""

    name: str = "tension-positive"

    def __post_init__(self) -> None:
        if self.name not in SIGNS:
            raise InputError(f'signs = "{self.name}" is unknown: use "tension-positive" or "compression-positive"')

    @property
    def factor(self) -> float:
        """+1 for tension positive, −1 for compression positive."""
        return 1.0 if self.name == "tension-positive" else -1.0

    def percent(self, strain: Array) -> Array:
        """Strain in per cent under this convention."""
        return self.factor * 100.0 * strain

    @property
    def axial(self) -> str:
        """Label of the axial strain."""
        return f"axial strain {self._eps('zz')} [%] ({self._word})"

    @property
    def volume(self) -> str:
        """Label of the volume strain."""
        word = "dilation" if self.factor > 0 else "contraction"
        return f"volume strain {self._eps('v')} [%] ({word} +)"

    @property
    def lateral(self) -> str:
        """Label of the lateral strain."""
        return f"lateral strain {self._eps('r')} [%] ({self._word})"

    def _eps(self, index: str) -> str:
        return rf"$\varepsilon_{{{index}}}$"

    @property
    def _word(self) -> str:
        return "extension +" if self.factor > 0 else "compression +"


def colours(levels: Sequence[float]) -> dict[float, str]:
    """One colour per confining pressure."""
    return {level: _PALETTE[k % len(_PALETTE)] for k, level in enumerate(sorted(levels))}


def canvas(rows: int, columns: int, *, height: float = 2.7, **options: Any) -> tuple[Any, Any]:
    """A figure of `rows` × `columns` axes, 7.2 inches wide; the axes as an array (rows, columns)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, height * rows), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def styled(draw: Callable[..., Any]) -> Callable[..., Any]:
    """A drawing function under this style (matplotlib reads part of it when text is set)."""

    @wraps(draw)
    def run(*arguments: Any, **options: Any) -> Any:
        import matplotlib

        with matplotlib.rc_context(STYLE):
            return draw(*arguments, **options)

    return run


def legend_below(figure: Any, handles: Any, labels: Sequence[str], columns: int = 5) -> None:
    """One legend for the whole figure, under it."""
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def picture(figure: Any, kind: str = "svg") -> bytes:
    """The figure as SVG or PNG bytes, the same bytes for the same figure."""
    import matplotlib

    buffer = BytesIO()
    metadata = {"Date": None} if kind == "svg" else {"Software": None}
    with matplotlib.rc_context(STYLE):
        figure.savefig(buffer, format=kind, metadata=metadata, dpi=160)
    return buffer.getvalue()


def shown(figure: Any) -> Any:
    """The figure, which a notebook now shows by itself, without pyplot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    if not isinstance(figure.canvas, FigureCanvasAgg):
        FigureCanvasAgg(figure)
    figure._repr_png_ = partial(picture, figure, "png")
    return figure


def unit_scale(size: float, unit: str = "Pa") -> tuple[float, str]:
    """Factor to the multiple of a unit in which a number of this size reads best, and its name; the unit itself below a billionth of it.

    >>> unit_scale(2.5e6), unit_scale(0.02, "m"), unit_scale(0.0, "N")
    ((1e-06, 'MPa'), (1000.0, 'mm'), (1.0, 'N'))
    """
    for factor, prefix in ((1e-9, "G"), (1e-6, "M"), (1e-3, "k"), (1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n")):
        if size * factor >= 1.0:
            return factor, prefix + unit
    return 1.0, unit
