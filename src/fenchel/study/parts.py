"""The parts of the study, in the order of its claims."""

from __future__ import annotations

from .claim import Claim, Part

__all__ = ["all_parts", "claims_by_number"]


def all_parts() -> tuple[Part, ...]:
    """Parts A to L; imported when asked, as some of them are slow to import."""
    from .bead_claims import BEAD
    from .contact_claims import CONTACT
    from .context_claims import CONTEXT
    from .crushing_claims import CRUSHING
    from .cyclic_claims import CYCLIC
    from .deposit_claims import DEPOSIT
    from .field_claims import FIELDS
    from .formulations import FORMULATIONS
    from .identification_claims import IDENTIFICATION
    from .length_claims import LENGTH
    from .model_claims import MODEL
    from .stiffness_claims import STIFFNESS

    return (
        CONTEXT, FORMULATIONS, MODEL, CYCLIC, CRUSHING, CONTACT, DEPOSIT, LENGTH, BEAD, STIFFNESS, FIELDS, IDENTIFICATION,
    )  # fmt: skip


def claims_by_number() -> dict[int, tuple[Part, Claim]]:
    """Every claim with its part."""
    return {claim.number: (part, claim) for part in all_parts() for claim in part.claims}
