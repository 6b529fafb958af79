"""The solved points of a reduced or closed step: functions of the law at the answer, and active faces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .parameter_slopes import FunctionSlopes, ParameterSlopes
from .plan import FIRST_SCALAR, LINES, METRIC, MOVING, PLACES, SCALARS, TENSORS, UNKNOWNS
from .sensitivity_answer import ReducedAnswer, closed_faces, function_values
from .sensitivity_faces import Faces, Local, face_slope, find_faces, power_compliance, times

__all__ = ["SolvedPoints", "StepData", "taken"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StepData:
    """Points of a step: strains (p, 6), packed old and new states, `kernel` coefficients of the compiled step, `c` (L, N) and `dc`
    (L, N, K) of `parameter_slopes`, the `answer` of the method (of a closed form the trial only), values of θ (numbers or (p,)), dt,
    which θ the first columns are, d_old (p, size, K), d_eps (p, 6, K)."""

    eps: Array
    old: Array
    new: Array
    kernel: Array
    c: Array
    dc: Array
    answer: ReducedAnswer
    theta: list[Any]
    dt: Any
    chosen: list[int]
    d_old: Array
    d_eps: Array


class SolvedPoints:
    """Points of a step that `update` has taken, with the sizes and places of its law."""

    def __init__(self, update: Any, slopes: ParameterSlopes, step: StepData) -> None:
        self.update, self.slopes, self.step = update, slopes, step
        self.plan = np.array(slopes.plan, dtype=np.int64)
        p = slopes.plan
        self.n, self.first = p[UNKNOWNS], p[FIRST_SCALAR]
        after = PLACES + p[TENSORS]
        self.scalar_places = list(p[after : after + p[SCALARS]])
        self.moving_places = list(p[after + p[SCALARS] : after + p[SCALARS] + p[MOVING]])
        self.frozen_places = list(p[after + p[SCALARS] + p[MOVING] :])
        self.tensor_places = list(p[PLACES:after])
        self.reduction = slopes.reduction
        self.quadratic = self.reduction.moduli.quadratic

    def _orders(self) -> Array:
        return np.array(self.reduction.order_rows, dtype=float).reshape(-1, self.n)

    def metric(self) -> Array:
        """W (L, n, n), that of non-linear hardening left zero."""
        start = int(self.plan[METRIC])
        return self.step.c[:, start : start + self.n * self.n].reshape(-1, self.n, self.n)

    def _affine_local(self, z: Array) -> Local:
        m, n, start = len(self.reduction.surfaces), self.n, int(self.plan[LINES])
        lines = self.step.c[:, start : start + m * (n + 1)].reshape(-1, m, n + 1)
        orders = np.broadcast_to(self._orders()[None], (len(lines), *self._orders().shape))
        normals = np.concatenate([lines[:, :, :n], orders], axis=1)
        f = times(z[:, None, :], normals.transpose(0, 2, 1))[:, 0]
        f[:, :m] += lines[:, :, n]
        return Local(self.metric(), f, normals, np.zeros_like(z), None)

    def _curved_local(self, z: Array, gamma: Array) -> Local:
        """Functions at z; γ is that of the surfaces and orders."""
        data = self._data_at_end()
        m = len(self.reduction.functions)
        pointers = self.update.pointers
        f, g, flow, hessian, block = function_values(pointers.law, self.plan, z, data, gamma[:, :m], self.step.kernel)
        orders = self._orders()
        normals = np.concatenate([g, np.broadcast_to(orders, (len(z), *orders.shape))], axis=1)
        metric = np.array(np.broadcast_to(self.metric(), (len(z), self.n, self.n)))
        if not self.quadratic:
            metric[:, self.first :, self.first :] = block
        return Local(metric, np.concatenate([f, z @ orders.T], axis=1), normals, flow, hessian)

    def _data_at_end(self) -> Array:
        """Moving scalars at the end of the step, frozen ones at its start."""
        return np.hstack([self.step.new[:, self.moving_places], self.step.old[:, self.frozen_places]])

    def answer(self) -> tuple[ReducedAnswer, Faces, Local]:
        """The answer of the step, its active faces, and the functions there."""
        s = self.step
        if self.update.module.METHOD == "closed":
            return self._closed_answer()
        answer = s.answer
        soft = self.reduction.soft is not None
        if self.reduction.affine:
            local = self._affine_local(answer.z)
            return answer, find_faces(local, answer, False, False, lambda points, gamma: (None, None)), local
        m = len(self.reduction.functions) + len(self.reduction.order_rows)
        local = self._curved_local(answer.z, np.zeros((len(answer.z), m)))

        def bend(points: Any, gamma: Array) -> tuple[Array, Array | None]:
            part = SolvedPoints(self.update, self.slopes, taken(s, points))
            hessian = part._curved_local(answer.z[points], gamma).hessian
            assert hessian is not None
            if not soft or not (gamma[:, 0] > 0.0).all():
                return hessian, None
            return hessian, power_compliance(gamma[:, 0], part.functions(answer.z[points], gamma))[0]

        faces = find_faces(local, answer, self.reduction.finite != 0, soft, bend)
        return answer, faces, self._curved_local(answer.z, faces.gamma)

    def _closed_answer(self) -> tuple[ReducedAnswer, Faces, Local]:
        s = self.step
        bare = s.answer
        region = closed_faces(self.update.pointers.plan, s.kernel, s.eps, s.old)
        local = self._affine_local(bare.trial)
        count, m = local.f.shape
        e, z, gamma = np.zeros_like(bare.trial), bare.trial.copy(), np.zeros((count, m))
        slope = np.zeros((count, self.n, self.n))
        members: list[tuple[int, ...]] = []
        groups: list[NDArray[np.int64]] = []
        for number, active in enumerate(([], [0], [0, 1])):
            rows: list[int] = list(active)
            points = np.flatnonzero(region == number)
            if not points.size:
                continue
            here = local.at(points)
            if rows:
                found, good = _affine_multipliers(here, rows)
                if not good.all():
                    # an apex that no modulus but that of the norm holds: a cohesion of zero
                    rows = [0]
                    found, _ = _affine_multipliers(here, rows)
                gamma[points[:, None], rows] = found
                e[points] = np.einsum(
                    "pi,pij->pj", found, np.broadcast_to(here.normals, (len(points), m, self.n))[:, rows]
                )
                z[points] -= times(e[points][:, None, :], here.metric)[:, 0]
                slope[points] = face_slope(here, rows)
            members.append(tuple(rows))
            groups.append(points)
        answer = replace(bare, e=e, z=z, slope=slope)
        return answer, Faces(members, groups, gamma), local

    def functions(self, z: Array, gamma: Array) -> FunctionSlopes:
        """Derivatives of the law's own functions by θ at given forces and multipliers."""
        m = len(self.reduction.functions)
        return self.slopes.functions(z, self._data_at_end(), gamma[:, :m], self.step.theta, self.step.dt)


def _affine_multipliers(local: Local, rows: list[int]) -> tuple[Array, NDArray[np.bool_]]:
    """γ of an active set from f at the trial, and where the set is independent."""
    G = local.normals[:, rows]
    gram = G @ local.metric @ G.transpose(0, 2, 1)
    diagonal = np.diagonal(gram, axis1=1, axis2=2)
    root = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, np.inf))
    unit = gram * root[:, :, None] * root[:, None, :]
    good = np.linalg.eigvalsh(unit)[:, 0] > 1e-14
    inverse = np.linalg.inv(np.where(good[:, None, None], unit, np.eye(len(rows))))
    found = times((local.f[:, rows] * root)[:, None, :], inverse)[:, 0] * root
    return found, good


def taken(step: StepData, points: Any) -> StepData:
    """The step at some of its points."""

    def at(value: Any) -> Any:
        return value[points] if isinstance(value, np.ndarray) and value.ndim and value.shape[0] > 1 else value

    return StepData(
        step.eps[points],
        step.old[points],
        step.new[points],
        at(step.kernel),
        at(step.c),
        at(step.dc),
        step.answer.at(points),
        [at(t) for t in step.theta],
        at(step.dt),
        step.chosen,
        step.d_old[points],
        step.d_eps[points],
    )
