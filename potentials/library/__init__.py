"""Library of laws, one file per law, and the table that finds them.

`LAWS` maps a name to its `Law`; every law carries one line of description (`law.note`) and parameters with units.
"""

from ._drucker_prager import drucker_prager
from ._linear_elastic import linear_elastic
from ._reinforced_sand import reinforced_sand
from ._sand import sand
from ._texsol import texsol
from ._von_mises import von_mises
from ._wire import wire

__all__ = ["LAWS", "drucker_prager", "linear_elastic", "reinforced_sand", "sand", "texsol", "von_mises", "wire"]

LAWS = {law.name: law for law in (linear_elastic, wire, von_mises, drucker_prager, sand, reinforced_sand, texsol)}
