r"""What a contact law and a wire law say, as data: a few expressions, from which the kernels of a scene are written.

Every contact law here reads, with p_n' = p_n − p_0,

    p_n' = p_n − p_0 ,   (p_n', p_t) ∈ K_μ ∋ ,   0 ≤ u_n + b + c_n p_n ⊥ p_n' ≥ 0 ,   u_t + c_t (p_t − p_t⁰) Coulomb at μ p_n' ,

so a law is five expressions: the bias velocity b, the compliances c_n and c_t, the coefficient μ and the least normal impulse p_0. What it
does not state does not exist in the code of the scene: without μ there is no tangential unknown. An expression that mentions nothing of a
single contact is a number of the step, the others are a column of the rows.

To add a law, write one file: a frozen dataclass whose fields are the parameters, with a method `rule`:

```python
@dataclass(frozen=True, kw_only=True)
class Cohesive(ContactLaw):
    friction: float
    adhesion: float  # N

    def rule(self) -> ContactRule:
        return ContactRule(bias="max(gap, 0.0) / step", friction="friction", least="-adhesion * step")
```

Names that an expression may use besides the fields: `step` h [s]; and of a contact `gap` g at detection [m], `approach` u_n⁻ and `slip`
‖u_t⁻‖ before the step [m/s], `radius` r_i r_j/(r_i + r_j) [m], `mass` 1/(1/m_i + 1/m_j) [kg], `impulse` p_n of the step before [N s],
`bead` (either body is a bead); and numpy as `np`. A wire law (`WireRule`) uses `distance` d, `natural` l₀ [m] and `approach` ḋ⁻.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass, fields
from typing import ClassVar

from ...errors import DeclarationError

__all__ = ["ContactLaw", "ContactRule", "WireLaw", "WireRule", "names_in"]

CONTACT_NAMES = frozenset({"gap", "approach", "slip", "radius", "mass", "impulse", "bead"})
LINK_NAMES = frozenset({"distance", "natural", "approach"})


@dataclass(frozen=True, kw_only=True)
class ContactRule:
    """The expressions of a contact law; an empty one is absent from the code.

    bias b [m/s], compliances c_n, c_t [m/(N s) per step, i.e. 1/(k h²)], friction μ [-], least normal impulse p_0 [N s, 0 if absent],
    and the condition under which a candidate becomes a contact at all.
    """

    bias: str
    normal_compliance: str = ""
    tangential_compliance: str = ""
    friction: str = ""
    least: str = ""
    touching: str = "gap <= reach"


@dataclass(frozen=True, kw_only=True)
class WireRule:
    """The expressions of a wire law: β [m/s], compliance c [m/(N s)], and whether the tension r has a sign, r ≥ 0."""

    unilateral: bool
    bias: str = ""
    compliance: str = ""


class _Law:
    """Parameters are the fields, in order."""

    label: ClassVar[str] = ""

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(f.name for f in fields(cls))  # type: ignore[arg-type]

    def parameters(self) -> tuple[float, ...]:
        """Values of the parameters, in the order of the names."""
        return tuple(float(getattr(self, name) or 0.0) for name in self.parameter_names())


class ContactLaw(_Law):
    """A contact law: a frozen dataclass of parameters with a `rule`."""

    def rule(self) -> ContactRule:
        """The expressions of the law for its present parameters."""
        raise NotImplementedError

    def normal_stiffness(self) -> float:
        """k_n [N/m] of the law, inf for rigid grains: for reports."""
        return float("inf")


class WireLaw(_Law):
    """A wire law: a frozen dataclass of parameters with a `rule`."""

    def rule(self) -> WireRule:
        """The expressions of the law for its present parameters."""
        raise NotImplementedError


def names_in(expression: str, law: ContactLaw | WireLaw, allowed: frozenset[str]) -> frozenset[str]:
    """Names that an expression of a law mentions; `DeclarationError` when one of them is none of those that exist."""
    try:
        tree = ast.parse(expression, mode="eval")
    except SyntaxError:
        raise DeclarationError(
            f"{type(law).__name__}: {expression!r} is no expression of Python: write a formula"
        ) from None
    found = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} - {"np", "max", "min", "abs"}
    known = {"step", "reach", *law.parameter_names(), *allowed}
    if found - known:
        raise DeclarationError(
            f"{type(law).__name__}: {expression!r} mentions {', '.join(sorted(found - known))}; "
            f"an expression may use {', '.join(sorted(known))}"
        )
    return frozenset(found)
