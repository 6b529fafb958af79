"""Names: what may be called what, checked before any code is written, and how a name is typeset.

Generated code uses the user's names as they stand, so a name must be a plain ASCII identifier that neither Python, nor the
generated modules, nor the arguments of `update` use. The generator keeps names that end with an underscore for itself.
"""

from __future__ import annotations

import keyword
import re

from ..errors import DeclarationError

__all__ = ["RESERVED", "checked_name", "latex_name"]

RESERVED = frozenset(
    """
    abs add_positive_derivative add_positive_derivative_axes add_positive_derivative_plane bool certify complex control divmod dt
    e eps_new float float64 gap int len list math max min nan njit norm6 norm_of np numba numpy pi positive_part
    positive_part_axes positive_part_plane pow print range round self sorted stack state status str sum tuple type update values
    """.split()  # noqa: SIM905
)
_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
_GREEK = frozenset(
    """
    alpha beta gamma delta zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi
    psi omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega
    """.split()  # noqa: SIM905
)


def checked_name(name: object, what: str) -> str:
    """Return `name` if it can stand in generated code; `DeclarationError` says which rule it breaks."""
    if not isinstance(name, str):
        raise DeclarationError(f"{what}: a name is a string, not {type(name).__name__}")
    shown = repr(name if len(name) <= 40 else name[:37] + "...")
    if len(name) > 60:
        raise DeclarationError(f"{what} {shown}: a name has at most 60 characters, this one has {len(name)}")
    if not _IDENTIFIER.match(name) or name.endswith("_"):
        raise DeclarationError(
            f"{what} {shown}: a name begins with a letter and holds letters, digits and inner underscores only (for example 'H_k')"
        )
    if keyword.iskeyword(name) or keyword.issoftkeyword(name) or name in RESERVED:
        raise DeclarationError(f"{what} {shown}: the name is reserved; choose another, for example '{name}_0'")
    return name


def latex_name(name: str) -> str:
    """`eps_p` as `\\varepsilon_{p}`, `theta_f` as `\\theta_{f}`."""
    head, *tail = name.split("_")
    words = [_latex_word(head), *(_latex_word(part) for part in tail)]
    return words[0] + ("_{" + ",".join(words[1:]) + "}" if tail else "")


def _latex_word(word: str) -> str:
    if word == "eps":
        return r"\varepsilon"
    if word == "sig":
        return r"\sigma"
    return "\\" + word if word in _GREEK else word
