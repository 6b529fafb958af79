"""Run files: one HDF5 file per run, replaced atomically, so that a kill or a full disk leaves the last complete one.

The image is built in memory, written beside the target, flushed to the disk and moved over it. Units and provenance are attributes.
"""

from __future__ import annotations

import hashlib
import io
import json
import platform
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..cache import replace_file, source_hash
from ..errors import InputError

__all__ = ["UNITS", "load_run", "replace_file", "save_run"]

FORMAT = 3

UNITS = {
    "pressure": "Pa", "axial_strain": "1", "wall_strain": "1", "wall_stress": "Pa", "box_stress": "Pa", "octant_volume": "m3",
    "grain_moment": "J", "bead_moment": "J", "link_moment": "J", "x": "m", "radius": "m", "mass": "kg", "velocity": "m/s",
    "spin": "m/s", "half": "m", "box_velocity": "m/s", "box_mass": "kg", "plane_place": "m", "plane_velocity": "m/s",
    "link_length": "m", "link_impulse": "N s", "pair_impulse": "N s", "wall_impulse": "N s", "listed_x": "m", "listed_place": "m",
    "listed_reach": "m", "step": "s", "elastic_energy": "J", "time": "s", "elastic": "J", "friction": "J", "algorithmic": "J",
    "shock": "J", "external": "J", "kinetic": "J", "balance": "J", "wires": "J", "damping": "J", "weight": "J", "drive": "J",
    "strain_sand": "1", "strain_wire": "1", "stress_grains": "Pa", "stress_beads": "Pa", "stress_links": "Pa", "force_mean": "N",
    "overlap_mean": "m", "overlap_max": "m", "violation_max": "m", "natural_map": "1", "natural_map_max": "1", "unbalanced": "1",
    "sliding": "1", "closed": "1", "sweeps": "1", "change": "1", "inertial_number": "1", "speed": "1", "sphere": "m",
    "start_half": "m", "start_x": "m", "distance": "m", "height": "m", "angles": "deg", "start": "J", "wire_density": "m-2",
    # count, Σx, Σu, Σx⊗x, Σu⊗x one after the other
    "grain_fit": "1, m, m2", "bead_fit": "1, m, m2",
}  # fmt: skip


_PROVENANCE = ("format", "program", "python", "conventions", "units", "versions", "machine", "source")


def _put(group: Any, name: str, value: Any) -> None:
    if isinstance(value, dict):
        inner = group.create_group(name)
        for key, item in value.items():
            _put(inner, key, item)
    elif isinstance(value, np.ndarray):
        data = group.create_dataset(name, data=value, compression="gzip" if value.size > 4096 else None)
        if name in UNITS:
            data.attrs["unit"] = UNITS[name]
    else:
        group.attrs[name] = value


def _take(group: Any) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, value in group.attrs.items():
        if not isinstance(value, np.ndarray) and hasattr(value, "item"):
            value = value.item()
        out[key] = value
    for key, item in group.items():
        out[key] = _take(item) if hasattr(item, "items") else item[()]
    return out


def _versions() -> dict[str, str]:
    """Versions of what computes."""
    import llvmlite
    import numba
    import scipy

    return {module.__name__: module.__version__ for module in (np, numba, llvmlite, scipy)}


def save_run(path: Path | str, content: dict[str, Any], settings: dict[str, Any]) -> None:
    """Write a nested dictionary of arrays, numbers and strings as one HDF5 file, with the settings, versions and units that made it.

    No date and no name of a machine: equal runs give equal files.
    """
    import h5py

    taken = set(content) & {*_PROVENANCE, "settings"}
    if taken:
        raise ValueError(
            f"{path}: the name {sorted(taken)[0]!r} is one of the file itself; call that result something else"
        )
    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        file.attrs["format"] = FORMAT
        file.attrs["program"] = f"fenchel {__version__}"
        file.attrs["python"] = platform.python_version()
        file.attrs["conventions"] = (
            "SI units; tension positive; components xx, yy, zz, yz, xz, xy, shear not doubled; frame first"
        )
        file.attrs["units"] = json.dumps(UNITS, sort_keys=True)  # also of numbers that are attributes; not listed: 1
        file.attrs["versions"] = json.dumps(_versions(), sort_keys=True)
        file.attrs["machine"] = f"{platform.system()} {platform.machine()}"
        file.attrs["source"] = source_hash("dem")
        file.attrs["settings"] = json.dumps(settings, sort_keys=True)
        for key, value in content.items():
            _put(file, key, value)
    data = image.getvalue()
    replace_file(path, data + _SEAL + hashlib.sha256(data).digest())


# behind the HDF5 image, where other programs do not look: a damaged number must not pass for a result
_SEAL = b"fenchel-sha256-v1 "


def load_run(path: Path | str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read (content, settings) of a run file; `InputError` when it is missing, truncated or of another kind."""
    import h5py

    path = Path(path)
    tail = len(_SEAL) + hashlib.sha256().digest_size
    try:
        whole = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such run file: check the name") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}): check the name") from None
    data, seal = whole[:-tail], whole[-tail:]
    if seal != _SEAL + hashlib.sha256(data).digest():
        raise InputError(
            f"{path}: unreadable or truncated run file (its checksum is missing or does not match): remove it and run again"
        )
    with h5py.File(io.BytesIO(data), "r") as file:
        if file.attrs["format"] != FORMAT:
            raise InputError(
                f"{path}: format {file.attrs['format']} is not {FORMAT}: remove it and run again with this version"
            )
        content = _take(file)
    settings = json.loads(content.pop("settings"))
    for name in _PROVENANCE:
        content.pop(name, None)
    return content, settings
