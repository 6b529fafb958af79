"""Meshes of the usual bodies with named boundaries, and files that meshio reads."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError

__all__ = ["cylinder_section", "read_mesh", "rectangle", "ring_section"]


def rectangle(width: float, height: float, columns: int, rows: int, *, shape: str = "quad") -> Any:
    """[0, width] × [0, height] in `columns` × `rows` cells, boundaries "left", "right", "bottom", "top"; `shape` "quad" or "tri" (each cell
    cut into four by its diagonals, which does not lock in the plane)."""
    import skfem

    if not (width > 0 and height > 0 and columns >= 1 and rows >= 1):
        raise InputError("rectangle: width and height must be positive, and there must be at least one cell each way")
    x, y = np.linspace(0.0, width, columns + 1), np.linspace(0.0, height, rows + 1)
    if shape == "quad":
        mesh: Any = skfem.MeshQuad.init_tensor(x, y)
    elif shape == "tri":
        mesh = _crossed(x, y)
    else:
        raise InputError(f"rectangle: shape {shape!r} is not known; it is quad or tri")
    return mesh.with_boundaries(_sides(width, height))


def _sides(width: float, height: float) -> dict[str, Any]:
    tiny = 1e-9
    return {
        "left": lambda p: np.abs(p[0]) < tiny * width,
        "right": lambda p: np.abs(p[0] - width) < tiny * width,
        "bottom": lambda p: np.abs(p[1]) < tiny * height,
        "top": lambda p: np.abs(p[1] - height) < tiny * height,
    }


def _crossed(x: Any, y: Any) -> Any:
    import skfem

    columns, rows = x.size - 1, y.size - 1
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    middle = np.stack(np.meshgrid(0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1]), indexing="ij"), axis=-1).reshape(
        -1, 2
    )
    i, j = (a.reshape(-1) for a in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
    corner = i * (rows + 1) + j
    around = [corner, corner + rows + 1, corner + rows + 2, corner + 1]
    centre = grid.shape[0] + i * rows + j
    cells = np.concatenate([np.stack([around[k], around[(k + 1) % 4], centre]) for k in range(4)], axis=1)
    return skfem.MeshTri(np.concatenate([grid, middle]).T.copy(), cells)


def cylinder_section(radius: float, height: float, columns: int, rows: int, *, shape: str = "quad") -> Any:
    """Meridian section of a full cylinder, x = r, y = z; boundaries "axis", "side", "bottom", "top"."""
    mesh = rectangle(radius, height, columns, rows, shape=shape)
    names = {"left": "axis", "right": "side"}
    return _renamed(mesh, names)


def _renamed(mesh: Any, names: dict[str, str]) -> Any:
    return replace(mesh, _boundaries={names.get(k, k): v for k, v in mesh.boundaries.items()})


def ring_section(
    inner: float, outer: float, columns: int, rows: int, *, angle: float = 0.5 * np.pi, curved: bool = False
) -> Any:
    """Sector of a ring, columns along the radius, rows along the angle; boundaries "inside", "outside", "start" (angle 0, on the x
    axis) and "end". In plane strain a thick-walled tube; axisymmetric (x = r, y = z) a hollow sphere. `curved` sides are parabolas,
    the right partner of quadratic elements."""
    import skfem

    if not (0.0 < inner < outer and 0.0 < angle <= 0.5 * np.pi):
        raise InputError("ring_section: 0 < inner < outer and 0 < angle <= pi/2")
    flat = rectangle(outer - inner, angle, columns, rows)
    names = {"left": "inside", "right": "outside", "bottom": "start", "top": "end"}
    mesh: Any = skfem.MeshQuad2.from_mesh(flat) if curved else flat
    r, phi = inner + mesh.doflocs[0], mesh.doflocs[1]
    # the line of angle pi/2 is the axis: exactly, so that no radius is negative
    x = np.where(np.abs(phi - 0.5 * np.pi) < 1e-12, 0.0, r * np.cos(phi))
    bent = replace(mesh, doflocs=np.stack([x, r * np.sin(phi)]), _boundaries=flat.boundaries)
    return _renamed(bent, names)


def read_mesh(path: str | Path, boundaries: dict[str, Any] | None = None) -> Any:
    """Mesh of a file that meshio reads; its named facet sets become boundaries, `boundaries` adds more (functions of coordinates).

    Raises `InputError` where the file is missing or holds no mesh that scikit-fem knows.
    """
    import contextlib
    import io

    import skfem

    place = Path(path)
    if not place.is_file():
        raise InputError(f"mesh file {str(path)!r} does not exist or is not a file")
    try:
        with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
            mesh = skfem.Mesh.load(str(place))
    except (Exception, SystemExit) as error:  # meshio leaves the interpreter on a file that it cannot read
        line = "it is in no format that meshio knows" if isinstance(error, SystemExit) else str(error).splitlines()[0]
        raise InputError(f"mesh file {str(path)!r} cannot be read: {line}") from error
    return mesh.with_boundaries(boundaries) if boundaries else mesh
