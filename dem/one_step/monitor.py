"""What watches a solver: the best iterate so far, both errors by which convergence is judged, the work done, the time left."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks
from .measures import measure
from .problem import OneStepProblem
from .sweeps import natural_map, product, project

__all__ = ["Monitor"]

Array = NDArray[np.float64]


class Monitor:
    """Call it with an iterate x (n, 3) of the scaled problem; it answers whether to stop (converged, or out of time).

    The iterate is projected on the cones first. Convergence is declared only after `measures.measure` has confirmed it. Time is
    that of the processor in this thread.
    """

    def __init__(self, problem: OneStepProblem, blocks: Blocks, tolerance: float, time_limit: float) -> None:
        self.problem, self.blocks, self.tolerance = problem, blocks, tolerance
        self.sweeps = 0
        self.factorisations = 0
        self.best = np.zeros_like(blocks.q)
        self.error = np.inf
        self.converged = False
        self._deadline = time.thread_time() + time_limit
        self._size = float(np.linalg.norm(problem.q))
        self._unit = np.ones(len(blocks.mu))
        self._velocity = np.empty_like(blocks.q)
        self._residual = np.empty_like(blocks.q)

    def __call__(self, x: Array) -> bool:
        """Judge x; True when the solver shall stop."""
        if not np.all(np.isfinite(x)):
            return self.out_of_time
        tried = x.copy()
        project(tried, self.blocks.mu)
        error = self._judge(tried)
        if error < self.error:
            self.error, self.best = error, tried
            if error <= self.tolerance:
                self.converged = measure(self.problem, self.blocks.reactions(tried)).worst <= self.tolerance
        return self.converged or self.out_of_time

    @property
    def out_of_time(self) -> bool:
        """Whether the time is over."""
        return time.thread_time() > self._deadline

    @property
    def time_left(self) -> float:
        """Seconds of this thread that are left."""
        return self._deadline - time.thread_time()

    @contextmanager
    def within(self, seconds: float) -> Iterator[None]:
        """A shorter time limit for what is tried first; the old one counts again afterwards."""
        before = self._deadline
        self._deadline = min(before, time.thread_time() + seconds)
        try:
            yield
        finally:
            self._deadline = before

    def _judge(self, x: Array) -> float:
        """The larger of natural_map_q and natural_map_scaled, by compiled code."""
        b = self.blocks
        product(b.pointer, b.column, b.value, b.q, x, self._velocity)
        natural_map(x, self._velocity, b.mu, self._unit, self._residual)
        size = _weighted(x, b.scale)
        scaled = _weighted(self._residual, b.scale) / (size if size > 0.0 else 1.0)
        natural_map(x, self._velocity, b.mu, b.mobility, self._residual)
        plain = _weighted(self._residual, b.scale) / (self._size if self._size > 0.0 else 1.0)
        return max(scaled, plain)


def _weighted(x: Array, scale: Array) -> float:
    return float(np.sqrt(np.einsum("ij,ij,i,i->", x, x, scale, scale)))
