"""Symbols that the laws of the library share, so that a name means one thing."""

from __future__ import annotations

from ..scalars import parameter, scalar
from ..tensor import sym_tensor

eps = sym_tensor("eps")
eps_p = sym_tensor("eps_p")
alpha = sym_tensor("alpha")
p = scalar("p")

E = parameter("E", lower=0, unit="Pa", note="Young's modulus")
nu = parameter("nu", lower=-1, upper=0.5, unit="1", note="Poisson ratio")
E_s = parameter("E_s", lower=0, unit="Pa", note="Young's modulus of the sand")
nu_s = parameter("nu_s", lower=-1, upper=0.5, unit="1", note="Poisson ratio of the sand")
lambda_w = parameter("lambda_w", lower=0, unit="Pa", note="first Lamé modulus of the wires")
mu_w = parameter("mu_w", lower=0, unit="Pa", note="second Lamé modulus of the wires")
H_k = parameter("H_k", lower=0, unit="Pa", note="hardening, kinematic")
H_i = parameter("H_i", lower=0, unit="Pa", note="hardening, isotropic")
C_0 = parameter("C_0", lower=0, unit="Pa", note="cohesion: shear limit √J₂ at zero pressure")
theta_f = parameter("theta_f", lower=0, upper=1.57, unit="rad", note="friction angle: √J₂ = C_0 + P tan(theta_f)")
sigma_y = parameter("sigma_y", lower=0, unit="Pa", note="yield stress in uniaxial tension")
