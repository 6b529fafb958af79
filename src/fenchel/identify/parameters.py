"""The seven numbers of the law `texsol`."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import tan

__all__ = ["LawParameters"]


@dataclass(frozen=True, kw_only=True)
class LawParameters:
    """Sand E_s, nu, theta_f, C_0, H_k, H_i and wires E_w (with the same nu); Pa, rad, 1. E_w = 0 is the sand alone."""

    E_s: float
    E_w: float
    nu: float
    theta_f: float
    C_0: float
    H_k: float
    H_i: float

    @property
    def lambda_w(self) -> float:
        """First Lamé modulus of the wires [Pa]."""
        return self.E_w * self.nu / ((1.0 + self.nu) * (1.0 - 2.0 * self.nu))

    @property
    def mu_w(self) -> float:
        """Shear modulus of the wires [Pa]."""
        return self.E_w / (2.0 * (1.0 + self.nu))

    @property
    def bulk(self) -> float:
        """Bulk modulus of the sand, K_s = E_s/(3(1 − 2ν)) [Pa]."""
        return self.E_s / (3.0 * (1.0 - 2.0 * self.nu))

    @property
    def t(self) -> float:
        """tan θ_f [-]."""
        return tan(self.theta_f)

    def to_json(self) -> dict[str, float]:
        """By name."""
        return asdict(self)
