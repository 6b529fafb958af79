"""The reference study of wire-reinforced sand (Laniel, Alart, Pagano, c. 2008), as tests that can be run again.

`reproduce` runs it claim by claim; `cyclic` (its Fig. 3) and `crushing` (its Figs. 4 and 5) are the tests of the continuum part.
"""

from .claim import Claim, Verdict
from .reproduce import Reproduction, reproduce

__all__ = ["Claim", "Reproduction", "Verdict", "reproduce"]
