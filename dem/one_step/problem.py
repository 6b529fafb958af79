r"""The one-step contact problem as an object of its own.

Find reactions r and relative velocities u, three rows a contact with the **normal first**, such that

    u = W r + q ,   û = u + μ‖u_T‖ n ,   K* ∋ û ⟂ r ∈ K ,   K = Π {‖r_T‖ ≤ μ r_N} ,

which is Signorini's condition with Coulomb's law (de Saxcé and Feng 1998). W, 3n × 3n, is positive semidefinite, often rank deficient and,
in files of real simulations, not always symmetric: nothing here needs the symmetry. A problem is *local* (W and q given) or *global*:

    M v = H r + f ,  u = Hᵀ v + w   ⇒   W = Hᵀ M⁻¹ H ,  q = w + Hᵀ M⁻¹ f .

Units are those of the writer: with velocities [m/s] reactions are impulses [N s] and W is an inverse mass [1/kg].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from ...errors import InputError

__all__ = ["Bodies", "OneStepProblem"]

Array = NDArray[np.float64]

_LARGEST_BLOCK = 32  # of M, in degrees of freedom, that is inverted densely


@dataclass(frozen=True)
class Bodies:
    """The global form M v = H r + f, u = Hᵀ v + w: M (d × d) and H (d × 3n) sparse, f (d,), w (3n,)."""

    mass: sp.csr_matrix
    h: sp.csr_matrix
    f: Array
    w: Array


@dataclass(frozen=True)
class OneStepProblem:
    """u = W r + q with a Coulomb cone at each contact; `bodies` is there when the problem was given in global form.

    `local` and `of_bodies` make one and check it; a problem is never changed.
    """

    delassus: sp.csr_matrix  # W (3n, 3n)
    q: Array  # (3n,)
    mu: Array  # (n,) friction coefficients
    bodies: Bodies | None = None
    title: str = ""

    @classmethod
    def local(cls, delassus: Any, q: Any, mu: Any, *, title: str = "") -> OneStepProblem:
        """From W (dense or sparse, (3n, 3n)), q (3n,) and μ (n,). Raises `InputError` for shapes or values that make no problem."""
        matrix = sp.csr_matrix(delassus, dtype=float)
        matrix.sum_duplicates()
        return cls(matrix, np.array(q, dtype=float), np.array(mu, dtype=float), None, title)._checked()

    @classmethod
    def of_bodies(cls, mass: Any, h: Any, f: Any, w: Any, mu: Any, *, title: str = "") -> OneStepProblem:
        """From M (d, d), H (d, 3n), f (d,), w (3n,) and μ (n,). Raises `InputError` when M is singular or shapes do not fit."""
        mass, h = sp.csr_matrix(mass, dtype=float), sp.csr_matrix(h, dtype=float)
        mass.sum_duplicates()
        h.sum_duplicates()
        f, w, mu = np.array(f, dtype=float), np.array(w, dtype=float), np.array(mu, dtype=float)
        dofs = mass.shape[0]
        if mass.shape != (dofs, dofs) or h.shape[0] != dofs or f.shape != (dofs,) or w.shape != (h.shape[1],):
            raise InputError(
                f"M is {mass.shape[0]} x {mass.shape[1]}, H {h.shape[0]} x {h.shape[1]}, f {f.shape}, w {w.shape}: with d degrees "
                "of freedom and n contacts M is d x d, H d x 3n, f d and w 3n"
            )
        if not all(np.all(np.isfinite(a)) for a in (mass.data, h.data, f, w)):
            raise InputError("M, H, f or w holds a value that is not a finite number")
        flexible = _divide(mass, sp.csr_matrix(np.column_stack([f])) if dofs else sp.csr_matrix((0, 1)))
        q = w + np.asarray(h.T @ flexible.toarray()).ravel()
        matrix = sp.csr_matrix(h.T @ _divide(mass, h))
        return cls(matrix, q, mu, Bodies(mass, h, f, w), title)._checked()

    @property
    def contact_count(self) -> int:
        """Number of contacts n."""
        return len(self.mu)

    @property
    def asymmetry(self) -> float:
        """‖W − Wᵀ‖/‖W‖ (Frobenius); 0 for a symmetric operator."""
        largest = float(np.abs(self.delassus.data).max(initial=0.0))
        if largest == 0.0:
            return 0.0
        unit = self.delassus / largest  # so that the squares stay in range
        return float(sp.linalg.norm(unit - unit.T) / sp.linalg.norm(unit))

    @property
    def symmetric(self) -> bool:
        """Symmetric up to what round-off and a product of three matrices leave (1e-10)."""
        return self.asymmetry < 1e-10

    def velocity(self, r: Array) -> Array:
        """u = W r + q, shape (3n,)."""
        return self.delassus @ r + self.q

    def with_friction(self, mu: Any) -> OneStepProblem:
        """The same problem with other friction coefficients (a number, or one per contact)."""
        given = np.broadcast_to(np.asarray(mu, dtype=float), self.mu.shape).copy()
        return OneStepProblem(self.delassus, self.q, given, self.bodies, self.title)._checked()

    def _checked(self) -> OneStepProblem:
        rows = 3 * len(self.mu) if self.mu.ndim == 1 else -1
        if self.mu.ndim != 1 or self.q.shape != (rows,) or self.delassus.shape != (rows, rows):
            raise InputError(
                f"W is {self.delassus.shape[0]} x {self.delassus.shape[1]}, q {self.q.shape}, mu {self.mu.shape}: with n contacts "
                "mu holds n values, q 3n (normal first) and W is 3n x 3n"
            )
        if not (np.all(np.isfinite(self.delassus.data)) and np.all(np.isfinite(self.q))):
            raise InputError("W or q holds a value that is not a finite number")
        bad = np.flatnonzero(~(np.isfinite(self.mu) & (self.mu >= 0.0)))
        if bad.size:
            raise InputError(f"mu[{bad[0]}] = {self.mu[bad[0]]}: a friction coefficient is finite and not negative")
        diagonal = self.delassus.diagonal()
        negative = np.flatnonzero(diagonal < -1e-12 * np.max(np.abs(diagonal), initial=0.0))
        if negative.size:
            raise InputError(
                f"W[{negative[0]}, {negative[0]}] = {diagonal[negative[0]]:.3g}: W is positive semidefinite, its diagonal is not negative"
            )
        return self


def _divide(mass: sp.csr_matrix, right: sp.csr_matrix) -> sp.csr_matrix:
    """M⁻¹ B, sparse: by the inverse of the blocks of M where bodies are uncoupled, by one factorisation otherwise."""
    count, label = connected_components(mass, directed=False)
    if mass.shape[0] == 0:
        return right
    sizes = np.bincount(label, minlength=count)
    if sizes.max() == 1:
        diagonal = mass.diagonal()
        if np.any(diagonal == 0.0):
            raise InputError(
                f"M has a zero on its diagonal (row {int(np.argmin(np.abs(diagonal)))}): every body needs a mass"
            )
        return sp.csr_matrix(sp.diags(1.0 / diagonal) @ right)
    if sizes.max() <= _LARGEST_BLOCK:
        return sp.csr_matrix(_inverse_of_blocks(mass, label, count) @ right)
    try:
        factor = splu(sp.csc_matrix(mass))
    except RuntimeError as failure:
        raise InputError("M is singular: every body needs a mass and an inertia") from failure
    columns = [sp.csr_matrix(factor.solve(right[:, k : k + 256].toarray())) for k in range(0, right.shape[1], 256)]
    return sp.csr_matrix(sp.hstack(columns))


def _inverse_of_blocks(mass: sp.csr_matrix, label: NDArray[np.int32], count: int) -> sp.csr_matrix:
    order = np.argsort(label, kind="stable")
    start = np.searchsorted(label[order], np.arange(count + 1))
    rows, columns, values = [], [], []
    for k in range(count):
        dofs = order[start[k] : start[k + 1]]
        try:
            inverse = np.linalg.inv(mass[dofs][:, dofs].toarray())
        except np.linalg.LinAlgError as failure:
            raise InputError(
                f"M is singular in the block of row {dofs[0]}: every body needs a mass and an inertia"
            ) from failure
        rows.append(np.repeat(dofs, len(dofs)))
        columns.append(np.tile(dofs, len(dofs)))
        values.append(inverse.ravel())
    shape = mass.shape
    return sp.csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
