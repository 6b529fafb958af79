"""The reference study of wire-reinforced sand (Laniel, Alart, Pagano, c. 2008), as tests that can be run again.

`cyclic` (its Fig. 3) and `crushing` (its Figs. 4 and 5) are the continuum part.
"""

from ..errors import FenchelError

__all__ = ["FenchelError"]
