"""Derivatives of the reduced and closed steps: trial values, the projection, then tensors again, each differentiated where it stands.

Kind 0, n = dev B/q, slip = e_q/q:   d(slip dev B) = slip d(dev B) + n (de_q − slip dq), the second term absent where q is rounding;
kind 1, dB in the frame of B:        (dF)_ii = de_i,  (dF)_ij = (e_i − e_j)/(b_i − b_j) (dB)_ij, the limit of the step where equal.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .parameter_slopes import FunctionSlopes, ParameterSlopes
from .plan import (
    FIRST_SCALAR,
    KIND,
    LINES,
    METRIC,
    MOVING,
    NORM,
    SCALAR_START,
    SCALARS,
    STRAIN_START,
    TENSORS,
    TRACE_START,
    TRACES,
    UNKNOWNS,
)
from .sensitivity_answer import ReducedAnswer
from .sensitivity_faces import Change, Faces, Local, answered, power_compliance, times
from .sensitivity_points import SolvedPoints, StepData
from .sensitivity_strain import add_declared_energy, add_unilateral_energies

__all__ = ["step_derivatives"]

Array = NDArray[np.float64]
_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def step_derivatives(update: Any, slopes: ParameterSlopes, step: StepData) -> tuple[Array, Array, Array]:
    """(dσ (p, 6, K), dX (p, size, K), d dissipation (p, K)) of a step that `update` has taken."""
    return _Step(update, slopes, step).derivatives()


class _Step:
    def __init__(self, update: Any, slopes: ParameterSlopes, step: StepData) -> None:
        self.slopes, self.s = slopes, step
        self.plan = np.array(slopes.plan, dtype=np.int64)
        p = slopes.plan
        self.tensors, self.scalars, self.moving = p[TENSORS], p[SCALARS], p[MOVING]
        self.n, self.traces, self.norm, self.first = p[UNKNOWNS], p[TRACES], p[NORM], p[FIRST_SCALAR]
        self.points = SolvedPoints(update, slopes, step)
        self.places, self.scalar_places = self.points.tensor_places, self.points.scalar_places
        self.moving_places, self.frozen_places = self.points.moving_places, self.points.frozen_places
        self.reduction = slopes.reduction
        self.quadratic = self.reduction.moduli.quadratic
        self.width = step.d_eps.shape[2]
        self.old_moves = bool(step.d_old.any())
        self.strain_moves = bool(step.d_eps.any())
        self.live = np.asarray(step.dc.any(axis=(0, 2)))

    # -- linear maps of coefficients ----------------------------------------------------------------------------------------

    def _explicit(self, indices: list[int], basis: list[Array], out: Array) -> None:
        """Add Σ dc_i v_i to `out` (p, r, K) over the entries whose coefficient depends on θ; `basis` holds v_i (p, r)."""
        live = [(v, self.s.dc[:, i]) for i, v in zip(indices, basis, strict=True) if self.live[i]]
        if live:
            out += times(np.stack([v for v, _ in live], axis=2), np.stack([d for _, d in live], axis=1))

    def _tensor(self, pairs: list[tuple[int, int]], constant: int, vectors: list[Array], changes: list[Any]) -> Array:
        """Derivative (p, 6, K) of Σ (c₀ v + c₁ tr v I) + c I over tensors v (p, 6)."""
        c = self.s.c
        total = np.zeros((len(vectors[0]), 6, self.width))
        sphere = np.zeros((len(vectors[0]), self.width))
        round_ = np.zeros((len(vectors[0]), 1, self.width))
        for (first, second), change in zip(pairs, changes, strict=True):
            if change is None:
                continue
            if c[:, first].any():
                total += c[:, first, None, None] * change
            if c[:, second].any():
                sphere += c[:, second, None] * _trace(change)
        self._explicit([pair[0] for pair in pairs], vectors, total)
        traces = [_trace(v)[:, None] for v in vectors]
        self._explicit([constant, *(pair[1] for pair in pairs)], [np.ones((len(total), 1)), *traces], round_)
        sphere += round_[:, 0]
        total[:, :3] += sphere[:, None, :]
        return total

    def _scalar(self, indices: list[int], basis: list[Any], changes: list[Any]) -> Array:
        """Derivative (p, K) of Σ c_i v_i over numbers v_i (p,); a change None is of a constant."""
        total = np.zeros((len(self.s.eps), 1, self.width))
        for i, change in zip(indices, changes, strict=True):
            if change is not None and self.s.c[:, i].any():
                total[:, 0] += self.s.c[:, i, None] * change
        self._explicit(indices, [v[:, None] for v in basis], total)
        return total[:, 0]

    # -- the step -----------------------------------------------------------------------------------------------------------

    def derivatives(self) -> tuple[Array, Array, Array]:
        s, count = self.s, len(self.s.eps)
        d_eps = s.d_eps if self.strain_moves else None
        stress_pairs, base_pairs = [(0, 1)], [(3, 4)]
        old_changes: list[Any] = [d_eps]
        new_changes: list[Any] = [d_eps]
        old_vectors, new_vectors = [s.eps], [s.eps]
        d_new = s.d_old.copy()
        for k, p in enumerate(self.places):
            o = 6 + 5 * k
            base_pairs.append((o, o + 1))
            stress_pairs.append((o + 2, o + 3))
            old_vectors.append(s.old[:, p : p + 6])
            old_changes.append(s.d_old[:, p : p + 6] if self.old_moves else None)
        lost = np.zeros((count, self.width))
        if self.n:
            d_base = self._tensor(base_pairs, 5, old_vectors, old_changes)
            answer, faces, local = self.points.answer()
            if self.plan[KIND] == 0:
                d_base[:, :3] -= _trace(d_base)[:, None, :] / 3.0
                de, dz = self._norm_flow(answer, faces, local, d_base, d_new)
            else:
                de, dz = self._principal_flow(answer, faces, local, d_base, d_new)
            for j, p in enumerate(self.moving_places):
                d_new[:, p] += de[:, self.first + j]
            lost = (de * answer.z[:, :, None] + dz * answer.e[:, :, None]).sum(axis=1)
        for p in self.places:
            new_vectors.append(s.new[:, p : p + 6])
            new_changes.append(d_new[:, p : p + 6])
        d_stress = self._tensor(stress_pairs, 2, new_vectors, new_changes)
        moduli = self.reduction.moduli
        if moduli.rest != 0:
            known = dict(zip(self.slopes.symbols, s.theta, strict=True)) | {self.reduction.law.observable: s.eps}
            add_declared_energy(
                d_stress, self.reduction.law, moduli.rest, known, s.d_eps, [self.slopes.symbols[i] for i in s.chosen]
            )
        elif moduli.alone:
            start, traces, spectral = int(self.plan[STRAIN_START]), len(moduli.traces), len(moduli.spectral)
            add_unilateral_energies(d_stress, s.eps, s.d_eps, s.c, s.dc, start, traces, spectral)
        return d_stress, d_new, lost

    def _trial(self, d_head: Array | None) -> Array:
        """dz^tr (p, n, K), the head of norm or principal values given."""
        s, count = self.s, len(self.s.eps)
        found = np.zeros((count, self.n, self.width))
        if d_head is not None:
            found[:, : d_head.shape[1]] = d_head
        step, one = 2 + 2 * self.tensors, np.ones(count)
        for i in range(self.traces if self.plan[KIND] == 0 else 0):
            o = int(self.plan[TRACE_START]) + step * i
            states = [slice(p, p + 3) for p in self.places]
            basis = [_trace(s.eps), one, *(_trace(s.old[:, p]) for p in states)]
            changes: list[Any] = [_trace(s.d_eps) if self.strain_moves else None, None]
            changes += [_trace(s.d_old[:, p]) if self.old_moves else None for p in states]
            indices = [o, o + 1, *(o + 2 + 2 * k for k in range(self.tensors))]
            found[:, self.norm + i] = self._scalar(indices, basis, changes)
        for j in range(self.moving if self.quadratic else 0):
            o = int(self.plan[SCALAR_START]) + (1 + self.scalars) * j
            basis = [one, *(s.old[:, p] for p in self.scalar_places)]
            changes = [None, *(s.d_old[:, p] if self.old_moves else None for p in self.scalar_places)]
            found[:, self.first + j] = self._scalar(list(range(o, o + 1 + self.scalars)), basis, changes)
        return found

    def _respond(self, answer: ReducedAnswer, faces: Faces, local: Local, d_trial: Array) -> tuple[Array, Array]:
        """(de, dz) at all points from dz^tr."""
        s, n = self.s, self.n
        count = len(answer.z)
        a = d_trial.copy()
        start = int(self.plan[METRIC])
        d_metric = s.dc[:, start : start + n * n].reshape(len(s.dc), n, n * self.width)
        a -= times(answer.e[:, None, :], d_metric).reshape(count, n, self.width)
        m = len(local.f[0])
        b, c = np.zeros((count, n, self.width)), np.zeros((count, m, self.width))
        slopes: FunctionSlopes | None = None
        if self.reduction.affine:
            surfaces, lines = len(self.reduction.surfaces), int(self.plan[LINES])
            d_lines = s.dc[:, lines : lines + surfaces * (n + 1)].reshape(len(s.dc), surfaces, n + 1, self.width)
            for i in range(surfaces):
                if d_lines[:, i].any():
                    b += faces.gamma[:, i, None, None] * d_lines[:, i, :n]
                    c[:, i] = times(answer.z[:, None, :], d_lines[:, i, :n])[:, 0] + d_lines[:, i, n]
        else:
            slopes = self.points.functions(answer.z, faces.gamma)
            b = self._chained(slopes.gradient)
            c[:, : len(self.reduction.functions)] = self._chained(slopes.surfaces)
            if not self.quadratic:
                # R(s) with s = s_n + e: the change of s_n acts through the modulus at the end
                block = local.metric[:, self.first :, self.first :]
                d_start = np.stack([s.d_old[:, p] for p in self.moving_places], axis=1)
                a[:, self.first :] = self._chained(slopes.forces) - np.matmul(block, d_start)
        de, dz = np.zeros_like(a), a.copy()
        for rows, points in zip(faces.members, faces.points, strict=True):
            here = local.at(points)
            chosen = list(rows)
            if not chosen and here.hessian is None:
                continue
            change = Change(a[points], b[points], c[points][:, chosen])
            if not chosen:
                change = replace(change, c=np.zeros((len(points), 0, self.width)))
                if self.reduction.finite == 0:
                    continue
            if self.reduction.soft is not None and chosen[:1] == [0]:
                assert slopes is not None
                part = FunctionSlopes(*(getattr(slopes, f)[points] for f in FunctionSlopes.__dataclass_fields__))
                compliance, moved = power_compliance(faces.gamma[points, 0], part)
                shift = change.c.copy()
                shift[:, 0] += self._chained(moved[:, None, :], points)[:, 0]
                change = replace(change, c=shift, compliance=compliance)
            de[points], dz[points] = answered(here, chosen, change)
        return de, dz

    def _chained(self, slopes: Array, points: Any = slice(None)) -> Array:
        """Derivatives (p, r, θ + frozen) as those by the columns (p, r, K)."""
        found = np.zeros((*slopes.shape[:2], self.width))
        found[:, :, : len(self.s.chosen)] = slopes[:, :, self.s.chosen]
        behind = len(self.slopes.names)
        for j, p in enumerate(self.frozen_places):
            found += slopes[:, :, behind + j, None] * self.s.d_old[points][:, p][:, None, :]
        return found

    # -- tensors again --------------------------------------------------------------------------------------------------------

    def _norm_flow(
        self, answer: ReducedAnswer, faces: Faces, local: Local, d_base: Array, d_new: Array
    ) -> tuple[Array, Array]:
        s, count = self.s, len(self.s.eps)
        normal, slip = np.zeros((count, 6)), np.zeros(count)
        d_head = None
        if self.norm:
            q, e_q = answer.trial[:, 0], answer.e[:, 0]
            # the same test as in the reduced step: where the deviator is rounding of the strain, the limit P_qq
            size = 1e-13 * np.abs(s.c[:, 3]) * np.abs(s.eps).max(axis=1)
            clear = (q > size) & (np.abs(e_q) < 1e280 * q)
            safe = np.where(clear, q, 1.0)
            slip = np.where(clear, e_q / safe, answer.slope[:, 0, 0])
            modulus = self.points.metric()[:, 0, 0]
            slip = np.where(modulus > 0.0, np.clip(slip, 0.0, 1.0 / np.where(modulus > 0.0, modulus, 1.0)), slip)
            normal = np.where(clear[:, None], answer.b / safe[:, None], 0.0)
            d_head = np.matmul(normal[:, None, :], d_base)
        d_trial = self._trial(d_head)
        de, dz = self._respond(answer, faces, local, d_trial)
        flow, d_flow = slip[:, None] * answer.b, slip[:, None, None] * d_base
        if self.norm:
            d_flow += normal[:, :, None] * (de[:, 0] - slip[:, None] * d_trial[:, 0])[:, None, :]
        for k, p in enumerate(self.places):
            o = 6 + 5 * k
            weight, d_weight = s.c[:, o + 4], s.dc[:, o + 4]
            if weight.any() or d_weight.any():
                d_new[:, p : p + 6] += weight[:, None, None] * d_flow
                if d_weight.any():
                    d_new[:, p : p + 6] += times(flow[:, :, None], d_weight[:, None, :])
            for j in range(self.traces):
                i = int(self.plan[TRACE_START]) + (2 + 2 * self.tensors) * j + 3 + 2 * k
                ball = s.c[:, i, None] * de[:, self.norm + j] + s.dc[:, i] * answer.e[:, self.norm + j, None]
                d_new[:, p : p + 3] += ball[:, None, :]
        return de, dz

    def _principal_flow(
        self, answer: ReducedAnswer, faces: Faces, local: Local, d_base: Array, d_new: Array
    ) -> tuple[Array, Array]:
        s = self.s
        values, vectors = answer.axes[:, :3], answer.axes[:, 3:].reshape(-1, 3, 3)
        frame = np.empty((len(values), 6, 6))
        for row, (l, m) in enumerate(_PAIRS):
            x, y = vectors[:, :, l], vectors[:, :, m]
            for i, (r, t) in enumerate(_PAIRS):
                frame[:, row, i] = 0.5 * (x[:, r] * y[:, t] + x[:, t] * y[:, r]) * (1.0 if r == t else np.sqrt(2.0))
            if l != m:
                frame[:, row] *= np.sqrt(2.0)
        inside = np.matmul(frame, d_base)
        d_trial = self._trial(inside[:, :3])
        de, dz = self._respond(answer, faces, local, d_trial)
        e, slope = answer.e, answer.slope
        size = np.abs(values).sum(axis=1)
        turned = np.empty_like(inside)
        turned[:, :3] = de[:, :3]
        for row, (l, m) in enumerate(_PAIRS[3:], start=3):
            gap = values[:, l] - values[:, m]
            apart = np.abs(gap) > 1e-9 * size
            limit = 0.5 * (slope[:, l, l] + slope[:, m, m]) - 0.5 * (slope[:, l, m] + slope[:, m, l])
            theta = np.where(apart, (e[:, l] - e[:, m]) / np.where(apart, gap, 1.0), limit)
            turned[:, row] = theta[:, None] * inside[:, row]
        d_flow = np.matmul(frame.transpose(0, 2, 1), turned)
        flow = np.matmul(frame[:, :3].transpose(0, 2, 1), e[:, :3, None])[:, :, 0]
        for k, p in enumerate(self.places):
            o = 6 + 5 * k
            d_new[:, p : p + 6] += s.c[:, o + 4, None, None] * d_flow
            if s.dc[:, o + 4].any():
                d_new[:, p : p + 6] += times(flow[:, :, None], s.dc[:, o + 4][:, None, :])
        return de, dz


def _trace(tensors: Array) -> Array:
    return tensors[:, 0] + tensors[:, 1] + tensors[:, 2]
