"""Grains and wires by non-smooth contact dynamics: samples, tests, homogenised records, certificates.

Modules: `bodies` (the state), `detection`, `contacts` (rows of the one-step problem), `nlgs` (sweeps), `residual` (independent measures),
`stepping` (Moreau–Jean), `packing`, `preparation`, `triaxial`, `homogenise`, `record`, `scene`, `storage`, `run`, `certificate`.
"""

from ..errors import InputError as _InputError  # noqa: F401  (an import above the folder: `import dem` from a checkout fails)
from .bodies import Assembly
from .record import PhaseHistory, TriaxialRecord, mandel
from .run import Progress, load_record, run_scene
from .scene import Scene, read_scene
from .stepping import Drive, Material, Simulation, Solver
from .triaxial import TriaxialTest

__all__ = [
    "Assembly",
    "Drive",
    "Material",
    "PhaseHistory",
    "Progress",
    "Scene",
    "Simulation",
    "Solver",
    "TriaxialRecord",
    "TriaxialTest",
    "load_record",
    "mandel",
    "read_scene",
    "run_scene",
]
