"""Library of laws, one file per law, and the tables that find them.

`LAWS` maps a name to its `Law`. `ENTRIES` maps it to what is known beside the declaration: where the law comes from, values to try it with,
and a worked value.
`cone`, `cone_values`, `triaxial_friction` and `rescaled_pseudo_norm` convert readings of a friction angle and a cohesion.
"""

from . import (
    _bingham,
    _cam_clay,
    _drucker_prager,
    _drucker_prager_cap,
    _kelvin_voigt,
    _linear_elastic,
    _maxwell,
    _mobilised_friction,
    _mohr_coulomb,
    _norton,
    _perzyna,
    _rankine,
    _reinforced_sand,
    _sand,
    _sand_k2,
    _texsol,
    _texsol_k2,
    _thermo_elasto_plastic,
    _tresca,
    _von_mises,
    _wire,
)
from ._bingham import bingham
from ._cam_clay import cam_clay
from ._cones import cone, cone_values, rescaled_pseudo_norm, triaxial_friction
from ._drucker_prager import drucker_prager
from ._drucker_prager_cap import drucker_prager_cap
from ._entry import Entry, WorkedValue
from ._kelvin_voigt import kelvin_voigt
from ._linear_elastic import linear_elastic
from ._maxwell import maxwell
from ._mobilised_friction import mobilised_friction
from ._mohr_coulomb import mohr_coulomb
from ._norton import norton
from ._perzyna import perzyna
from ._rankine import rankine
from ._reinforced_sand import reinforced_sand
from ._sand import sand
from ._sand_k2 import sand_k2
from ._texsol import texsol
from ._texsol_k2 import texsol_k2
from ._thermo_elasto_plastic import thermo_elasto_plastic
from ._tresca import tresca
from ._von_mises import von_mises
from ._wire import wire

__all__ = [
    "ENTRIES",
    "LAWS",
    "Entry",
    "WorkedValue",
    "bingham",
    "cam_clay",
    "cone",
    "cone_values",
    "drucker_prager",
    "drucker_prager_cap",
    "kelvin_voigt",
    "linear_elastic",
    "maxwell",
    "mobilised_friction",
    "mohr_coulomb",
    "norton",
    "perzyna",
    "rankine",
    "reinforced_sand",
    "rescaled_pseudo_norm",
    "sand",
    "sand_k2",
    "texsol",
    "texsol_k2",
    "thermo_elasto_plastic",
    "tresca",
    "triaxial_friction",
    "von_mises",
    "wire",
]

ENTRIES = {
    module.ENTRY.law.name: module.ENTRY
    for module in (
        _linear_elastic,
        _wire,
        _maxwell,
        _kelvin_voigt,
        _bingham,
        _norton,
        _perzyna,
        _von_mises,
        _tresca,
        _drucker_prager,
        _drucker_prager_cap,
        _mobilised_friction,
        _mohr_coulomb,
        _rankine,
        _cam_clay,
        _sand,
        _sand_k2,
        _reinforced_sand,
        _texsol,
        _texsol_k2,
        _thermo_elasto_plastic,
    )
}
LAWS = {name: entry.law for name, entry in ENTRIES.items()}
