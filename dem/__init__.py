"""Grains and wires by non-smooth contact dynamics: samples, tests, homogenised records, certificates.

Modules: `bodies` (the state), `planes`, `laws` (contact and wire laws, one file each), `kernels` (code written for what a scene requires),
`detection`, `candidates`, `rows` (the solved one-step problem), `residual` (independent measures), `stepping` (Moreau–Jean), `packing`,
`preparation`, `triaxial`, `homogenise`, `record`, `scene`, `storage`, `run`, `certificate`.
"""

from ..errors import InputError as _InputError  # noqa: F401  (an import above the folder: `import dem` from a checkout fails)
from .bodies import Assembly
from .materials import Laws, Material
from .planes import Plane
from .record import PhaseHistory, TriaxialRecord, mandel
from .run import Progress, load_record, run_scene
from .scene import Scene, read_scene
from .stepping import Drive, Simulation, Solver
from .triaxial import TriaxialTest

__all__ = [
    "Assembly",
    "Drive",
    "Laws",
    "Material",
    "PhaseHistory",
    "Plane",
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
