"""FCLIB files (HDF5) of one-step problems: read local and global ones, write both.

Layout of the Frictional Contact Library 3.x: `fclib_local/{W, vectors/q, vectors/mu, spacedim}` or `fclib_global/{M, H, vectors/f, w,
mu}`. A sparse matrix is `m, n, nz, nzmax, p, i, x` with nz = −2 compressed rows (p pointers, i columns), −1 compressed columns,
≥ 0 triplets. Found in files and honoured here: triplets follow CSparse (p columns, i rows; the comment in fclib.h says the reverse);
nzmax may exceed nz, entries beyond nz are no entries; repeated triplets add up; strings need not be UTF-8.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from ...errors import InputError, StorageError
from .problem import OneStepProblem

if TYPE_CHECKING:
    import h5py

__all__ = ["read_fclib", "stored_velocity", "write_fclib"]


def read_fclib(path: Path | str) -> OneStepProblem:
    """The problem in an FCLIB file. Raises `InputError` in one line for a file that is none, is not 3D, or contradicts itself."""
    import h5py

    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file: give an FCLIB file (HDF5)")
    try:
        with h5py.File(path, "r") as file:
            return _read(file)
    except InputError as fault:
        raise InputError(f"{path}: {fault}") from None
    except (OSError, RuntimeError, LookupError, TypeError, ValueError, ArithmeticError, AttributeError) as fault:
        reason = " ".join(str(fault).split())[:160]
        raise InputError(f"{path}: not readable as an FCLIB file (HDF5): {reason}") from None


def stored_velocity(path: Path | str) -> np.ndarray | None:
    """`solution/u` of a file (3n,), or None. (`solution/r` is zero in every known file and therefore not offered.)"""
    import h5py

    with h5py.File(path, "r") as file:
        node = file.get("solution/u")
        return np.asarray(node[()], dtype=float).ravel() if isinstance(node, h5py.Dataset) else None


def write_fclib(problem: OneStepProblem, path: Path | str, *, description: str = "") -> None:
    """Write a problem: global form if it has bodies, local form otherwise. The file appears whole or not at all.

    Raises `StorageError` when the place cannot be written.
    """
    import h5py

    path = Path(path)
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with h5py.File(partial, "w") as file:
            root = file.create_group("fclib_local" if problem.bodies is None else "fclib_global")
            root["spacedim"] = np.array([3], dtype=np.int32)
            vectors = root.create_group("vectors")
            vectors["mu"] = problem.mu
            if problem.bodies is None:
                _write_matrix(root, "W", problem.delassus)
                vectors["q"] = problem.q
            else:
                _write_matrix(root, "M", problem.bodies.mass)
                _write_matrix(root, "H", problem.bodies.h)
                vectors["f"], vectors["w"] = problem.bodies.f, problem.bodies.w
            info = root.create_group("info")
            for name, text in (("title", problem.title), ("description", description), ("math_info", "")):
                info[name] = np.bytes_(text.encode() or b"\0")
        partial.replace(path)
    except OSError as fault:
        partial.unlink(missing_ok=True)
        raise StorageError(
            f"{path}: not written ({' '.join(str(fault).split())[:120]}): choose another place"
        ) from None


def _read(file: h5py.File) -> OneStepProblem:
    roots = [name for name in ("fclib_local", "fclib_global") if name in file]
    if not roots:
        rolling = [name for name in file if name.startswith("fclib")]
        found = f"it holds {rolling[0]}" if rolling else "it holds neither fclib_local nor fclib_global"
        raise InputError(
            f"no problem that fenchel solves: {found}; 3D Coulomb friction (fclib_local, fclib_global) is read"
        )
    root = file[roots[0]]
    dimension = _integer(root, "spacedim")
    if dimension != 3:
        kind = {2: "a plane problem (two rows a contact)", 5: "a rolling-friction problem (five rows a contact)"}
        raise InputError(
            f"spacedim = {dimension}, {kind.get(dimension, 'unknown to FCLIB')}: only 3 (normal, two tangents) is solved"
        )
    vectors = root.get("vectors")
    if vectors is None:
        raise InputError(f"{roots[0]}/vectors is missing: it holds mu and q (local) or f and w (global)")
    mu, title = _vector(vectors, "mu"), _title(root)
    if roots[0] == "fclib_local":
        if "V" in root or "R" in root:
            raise InputError(
                "the problem has bilateral constraints (V, R): only contacts are solved; condense the constraints first"
            )
        rows = 3 * len(mu)
        return OneStepProblem.local(_matrix(root, "W", rows, rows), _vector(vectors, "q"), mu, title=title)
    if "G" in root:
        raise InputError(
            "the problem has bilateral constraints (G): only contacts are solved; condense the constraints first"
        )
    f = _vector(vectors, "f")
    mass, h = _matrix(root, "M", len(f), len(f)), _matrix(root, "H", len(f), 3 * len(mu))
    return OneStepProblem.of_bodies(mass, h, f, _vector(vectors, "w"), mu, title=title)


def _data(group: Any, name: str) -> np.ndarray:
    if name not in group:
        raise InputError(f"{group.name.strip('/')}/{name} is missing")
    value = np.asarray(group[name][()])
    if value.dtype.kind not in "iuf":
        raise InputError(f"{group.name.strip('/')}/{name} holds no numbers")
    return value


def _integer(group: Any, name: str) -> int:
    value = _data(group, name).ravel()
    if not value.size:
        raise InputError(f"{group.name.strip('/')}/{name} is empty")
    return int(value[0])


def _vector(group: Any, name: str) -> np.ndarray:
    return _data(group, name).astype(float).ravel()


def _title(root: Any) -> str:
    node = root.get("info/title")
    value = node[()] if node is not None else b""
    return (
        bytes(np.ravel(value)[0] if np.ndim(value) else value).decode("utf-8", "replace").strip("\0 \n")
        if value is not None
        else ""
    )


def _matrix(root: Any, name: str, rows: int, columns: int) -> sp.csr_matrix:
    """Any of the three storage orders as compressed rows; size and indices are checked before scipy sees them."""
    if name not in root:
        raise InputError(f"{root.name.strip('/')}/{name} is missing")
    node = root[name]
    given = (_integer(node, "m"), _integer(node, "n"))
    if given != (rows, columns):
        raise InputError(f"{name} is {given[0]} x {given[1]}, the vectors beside it ask for {rows} x {columns}")
    kind = _integer(node, "nz")
    p, i = (_data(node, key).ravel().astype(np.int64) for key in ("p", "i"))
    x = _data(node, "x").astype(float).ravel()
    if kind >= 0:
        if min(len(p), len(i), len(x)) < kind:
            raise InputError(f"{name} announces {kind} triplets and holds {min(len(p), len(i), len(x))}")
        p, i, x = p[:kind], i[:kind], x[:kind]
        _inside(name, i, rows)
        _inside(name, p, columns)
        return sp.csr_matrix((x, (i, p)), shape=(rows, columns))
    if kind not in (-1, -2):
        raise InputError(
            f"{name} has nz = {kind}: -2 (compressed rows), -1 (compressed columns) or a number of triplets is known"
        )
    major, minor = (rows, columns) if kind == -2 else (columns, rows)
    if len(p) < major + 1 or p[0] != 0 or np.any(np.diff(p[: major + 1]) < 0) or p[major] > min(len(i), len(x)):
        raise InputError(f"{name} has pointers that do not fit its {major} {'rows' if kind == -2 else 'columns'}")
    p = p[: major + 1]
    i, x = i[: p[-1]], x[: p[-1]]
    _inside(name, i, minor)
    if kind == -2:
        return sp.csr_matrix((x, i, p), shape=(rows, columns))
    return sp.csr_matrix(sp.csc_matrix((x, i, p), shape=(rows, columns)))


def _inside(name: str, index: np.ndarray, bound: int) -> None:
    if index.size and (index.min() < 0 or index.max() >= bound):
        raise InputError(
            f"{name} has the index {int(index.max() if index.max() >= bound else index.min())} outside 0 ... {bound - 1}"
        )


def _write_matrix(root: Any, name: str, matrix: Any) -> None:
    compressed = sp.csr_matrix(matrix)
    node = root.create_group(name)
    for key, value in (("m", compressed.shape[0]), ("n", compressed.shape[1]), ("nz", -2), ("nzmax", compressed.nnz)):
        node[key] = np.array([value], dtype=np.int32)
    node["p"], node["i"] = compressed.indptr.astype(np.int32), compressed.indices.astype(np.int32)
    node["x"] = compressed.data
