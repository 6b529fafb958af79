r"""VTK files that ParaView opens: bodies as points, contact forces and wire tensions as lines.

XML PolyData (`.vtp`), binary, in SI units: lengths in m, forces in N. Bodies carry `radius`, `velocity`, `phase` (0 grain, 1 bead,
2 fixed), `wire`, `rank` and `contacts`; in ParaView: Glyph, type Sphere, scale by `radius`, factor 2. Contacts are lines between centres
(with walls: from the centre to the wall) with `normal_force`, `tangential_force`, `force` (on the first body), `mobilised` (friction,
1 where it slides) and `kind` (beads in the contact; 3: wall). Links are lines with `tension`, `length` and `wire`; in ParaView: Tube,
radius by scalar.

The VTK File Formats, chapter "XML file formats", Kitware.
"""

from __future__ import annotations

import base64
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from ... import __version__
from ..measures import Network
from ..storage import replace_file

__all__ = ["VtkSeries", "write_vtk"]

Array = NDArray[np.float64]

_TYPES = {"f": ("Float64", "<f8"), "i": ("Int64", "<i8")}


def _data_array(name: str, values: NDArray[np.generic]) -> str:
    kind, code = _TYPES["f" if values.dtype.kind == "f" else "i"]
    data = np.ascontiguousarray(values, dtype=code).tobytes()
    # the length of the block stands before it, encoded together
    text = base64.b64encode(np.uint64(len(data)).tobytes() + data).decode()
    parts = 1 if values.ndim == 1 else values.shape[1]
    return f'<DataArray type="{kind}" Name={quoteattr(name)} NumberOfComponents="{parts}" format="binary">{text}</DataArray>'


def _cells(name: str, connectivity: NDArray[np.int64]) -> str:
    size = connectivity.shape[1]
    offsets = size * np.arange(1, len(connectivity) + 1, dtype=np.int64)
    return f"<{name}>{_data_array('connectivity', connectivity.ravel())}{_data_array('offsets', offsets)}</{name}>"


def _spatial(values: Array) -> Array:
    """Vectors in space: those of the plane get a third component 0."""
    return values if values.shape[1] == 3 else np.concatenate([values, np.zeros((len(values), 1))], axis=1)


def _poly_data(
    time: float,
    points: Array,
    *,
    lines: NDArray[np.int64] | None = None,
    point_data: dict[str, NDArray[np.generic]] | None = None,
    cell_data: dict[str, NDArray[np.generic]] | None = None,
) -> bytes:
    """One `.vtp` file: a vertex per point, or the given lines."""
    verts = np.arange(len(points), dtype=np.int64)[:, None] if lines is None else np.empty((0, 1), dtype=np.int64)
    lines = np.empty((0, 2), dtype=np.int64) if lines is None else lines
    parts = [
        '<?xml version="1.0"?>',
        f"<!-- fenchel {__version__}; SI units: m, s, N -->",
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
        "<PolyData>",
        # ParaView takes the time of a single file from here
        '<FieldData><DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">'
        f"{time!r}</DataArray></FieldData>",
        f'<Piece NumberOfPoints="{len(points)}" NumberOfVerts="{len(verts)}" NumberOfLines="{len(lines)}" '
        'NumberOfStrips="0" NumberOfPolys="0">',
        "<PointData>",
        *(_data_array(name, values) for name, values in (point_data or {}).items()),
        "</PointData>",
        "<CellData>",
        *(_data_array(name, values) for name, values in (cell_data or {}).items()),
        "</CellData>",
        f"<Points>{_data_array('Points', _spatial(points))}</Points>",
        _cells("Verts", verts),
        _cells("Lines", lines),
        "</Piece>",
        "</PolyData>",
        "</VTKFile>",
        "",
    ]
    return "\n".join(parts).encode()


def _contacts(network: Network) -> bytes:
    known = np.isfinite(network.wall_normal).all(axis=1)
    body, push, normal = network.wall[known, 0], network.wall_force[known], network.wall_normal[known]
    count, walls = len(network.x), len(body)
    at_wall = network.x[body] - network.radius[body, None] * normal
    lines = np.concatenate([network.pair, np.stack([body, count + np.arange(walls)], axis=1)])
    force = network.normal_force[:, None] * network.normal + network.tangential_force
    tangential = np.linalg.norm(network.tangential_force, axis=1)
    limit = network.friction * network.normal_force
    mobilised = np.where(limit > 0.0, tangential / np.where(limit > 0.0, limit, 1.0), 0.0)
    nothing = np.zeros(walls)
    return _poly_data(
        network.time,
        np.concatenate([network.x, at_wall]),
        lines=lines,
        cell_data={
            "normal_force": np.concatenate([network.normal_force, push]),
            "tangential_force": np.concatenate([tangential, nothing]),
            "force": _spatial(np.concatenate([force, push[:, None] * normal])),
            "mobilised": np.concatenate([mobilised, nothing]),
            "kind": np.concatenate([network.kind, np.full(walls, 3)]),
        },
    )


def write_vtk(network: Network, stem: Path | str) -> list[Path]:
    """Write `STEM.bodies.vtp`, `STEM.contacts.vtp` and, where there are links, `STEM.wires.vtp`; returns what was written.

    Each file is replaced as a whole; `StorageError` when one cannot be written.
    """
    stem = str(stem)
    phase = np.where(network.fixed, 2, network.is_bead.astype(np.int64))
    ends = np.concatenate([network.pair.ravel(), network.wall[:, 0]])
    files = {
        f"{stem}.bodies.vtp": _poly_data(
            network.time,
            network.x,
            point_data={
                "radius": network.radius,
                "velocity": _spatial(network.velocity),
                "phase": phase,
                "wire": network.wire,
                "rank": network.rank,
                "contacts": np.bincount(ends, minlength=len(network.x)).astype(np.int64),
            },
        ),
        f"{stem}.contacts.vtp": _contacts(network),
    }
    if len(network.link):
        files[f"{stem}.wires.vtp"] = _poly_data(
            network.time,
            network.x,
            lines=network.link,
            cell_data={"tension": network.tension, "length": network.link_length, "wire": network.link_wire},
        )
    for name, data in files.items():
        replace_file(name, data)
    return [Path(name) for name in files]


class VtkSeries:
    """A run in pictures: `add` writes the files of one instant and the collections `STEM.bodies.pvd` and so on, which ParaView plays."""

    def __init__(self, stem: Path | str) -> None:
        self.stem: Path = Path(stem)
        self.times: list[float] = []

    def add(self, network: Network) -> list[Path]:
        """Write the next instant; returns its files."""
        written = write_vtk(network, self.stem.with_name(f"{self.stem.name}.{len(self.times):06d}"))
        self.times.append(network.time)
        for file in written:
            kind = file.suffixes[-2]
            entries = "\n".join(
                f'<DataSet timestep="{time!r}" file={quoteattr(f"{self.stem.name}.{k:06d}{kind}.vtp")}/>'
                for k, time in enumerate(self.times)
            )
            replace_file(
                self.stem.with_name(f"{self.stem.name}{kind}.pvd"),
                f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0">\n<Collection>\n{entries}\n'
                "</Collection>\n</VTKFile>\n".encode(),
            )
        return written
