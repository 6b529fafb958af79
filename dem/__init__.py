"""Grains and wires by non-smooth contact dynamics: samples, tests, homogenised records, certificates.

Modules: `bodies` (the state), `detection`, `contacts` (rows of the one-step problem), `nlgs` (sweeps), `residual` (independent measures),
`stepping` (Moreau–Jean), `packing`, `preparation`, `triaxial`, `homogenise`, `record`, `scene`, `storage`, `run`, `certificate`.
"""

from ..errors import ConvergenceError, InputError
from .record import PhaseHistory, TriaxialRecord, mandel

__all__ = ["ConvergenceError", "InputError", "PhaseHistory", "TriaxialRecord", "mandel"]
