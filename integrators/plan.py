"""Names of the integers through which a law tells the compiled reduced step its sizes and where its numbers stand.

`KIND` 0 norm and traces, 1 principal values; `TENSORS`, `SCALARS` internal variables; `UNKNOWNS` reduced forces, of which `NORM` (0 or 1)
a deviator norm, `TRACES` traces, `MOVING` scalar forces from place `FIRST_SCALAR`; `FROZEN` scalars; `SURFACES` (the function of the power
terms first, if `SOFT`), `ORDERS` constraints of the reduction itself; `VISCOUS` a smooth finite part, `CURVED` surfaces, `NONLINEAR`
hardening, `STRAIN` an energy of the strain alone (1; with -1 the numbers are those of -psi* over stresses, and strain and compliance come
out with their sign turned): flags. `*_START`, `METRIC`, `LINES`: places among the coefficients. From `PLACES`: places of tensors, scalars,
moving and frozen scalars in a packed state.
"""

from __future__ import annotations

(
    KIND,
    TENSORS,
    SCALARS,
    UNKNOWNS,
    TRACES,
    MOVING,
    NORM,
    TRACE_START,
    SCALAR_START,
    FROZEN,
    STRAIN_START,
    STRAIN,
    METHOD_START,
    LINES,
    SURFACES,
    ORDERS,
    SOFT,
    VISCOUS,
    CURVED,
    NONLINEAR,
    FIRST_SCALAR,
    METRIC,
    PLACES,
) = range(23)
