"""Grains and wires by non-smooth contact dynamics: samples, tests, homogenised records, certificates.

Modules: `bodies` (the state), `planes`, `shapes`, `laws` (contact and wire laws, one file each), `kernels` (code written for what a scene
requires), `detection`, `candidates`, `rows` (the solved one-step problem), `residual` (independent measures), `stepping` (Moreau–Jean),
`adaptive`, `relaxation`, `packing`, `preparation`, `triaxial`, `homogenise`, `record`, `scene`, `storage`, `run`, `certificate`.
"""

from ..errors import InputError as _InputError  # noqa: F401  (an import above the folder: `import dem` from a checkout fails)
from .adaptive import AdaptiveStep
from .bodies import Assembly
from .export.runs import Run, read_run
from .materials import Laws, Material
from .planes import Plane
from .record import PhaseHistory, TriaxialRecord, mandel
from .relaxation import Relaxation, relax
from .run import Progress, load_record, run_scene
from .scene import Scene, read_scene
from .shapes import chain, hexagonal_floor, lattice
from .stepping import Drive, Simulation, Solver
from .triaxial import TriaxialTest

__all__ = [
    "AdaptiveStep",
    "Assembly",
    "Drive",
    "Laws",
    "Material",
    "PhaseHistory",
    "Plane",
    "Progress",
    "Relaxation",
    "Run",
    "Scene",
    "Simulation",
    "Solver",
    "TriaxialRecord",
    "TriaxialTest",
    "chain",
    "hexagonal_floor",
    "lattice",
    "load_record",
    "mandel",
    "read_run",
    "read_scene",
    "relax",
    "run_scene",
]
