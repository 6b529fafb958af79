"""How much of the study is run: every day (`small`), in an hour or two (`medium`), and as the numbers deserve (`paper`)."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import InputError

__all__ = ["SIZES", "Size", "size_named"]


@dataclass(frozen=True, kw_only=True)
class Size:
    """Grain counts, seeds and sweeps of a reproduction; strains and stiffnesses in SI units."""

    name: str
    grains: int  # of a deposit and of the triaxial test of the same block
    seeds: int
    fine_grains: int  # of the sweeps over stiffness, bead radius and settings
    fine_seeds: int
    wire_stiffness: tuple[float, ...]  # k [N] of the elastic wires of the sweep
    bead_ratios: tuple[float, ...]  # bead radius over mean grain radius
    identify_grains: int
    identify_seeds: int
    pressures: tuple[float, ...]  # fitted [Pa]
    held_out: tuple[float, ...]  # predicted [Pa]
    permutations: int  # samples of a permutation test or bootstrap
    sweep: int  # points along each axis of the sweep of the cyclic test
    columns: tuple[int, ...]  # of the refinement study of the crushing test (rows alike)
    samples: int  # random states, strains or problems behind the claims that are theorems


SIZES = {
    size.name: size
    for size in (
        Size(
            name="small", grains=500, seeds=2, fine_grains=500, fine_seeds=1,
            wire_stiffness=(1.0, 10.0, 100.0), bead_ratios=(0.5, 0.3, 0.2, 0.1), identify_grains=500, identify_seeds=2,
            pressures=(5e4, 7e4, 9e4), held_out=(6e4,), permutations=499, sweep=2, columns=(10, 20, 40), samples=200,
        ),
        Size(
            name="medium", grains=4000, seeds=5, fine_grains=1000, fine_seeds=3,
            wire_stiffness=(1.0, 3.0, 10.0, 30.0, 100.0, 1000.0), bead_ratios=(0.5, 0.4, 0.3, 0.2, 0.15, 0.1), identify_grains=1000,
            identify_seeds=3, pressures=(5e4, 7e4, 8e4, 9e4), held_out=(6e4,), permutations=1999, sweep=3, columns=(10, 20, 40),
            samples=400,
        ),
        Size(
            name="paper", grains=10_000, seeds=5, fine_grains=3000, fine_seeds=5,
            wire_stiffness=(0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 1000.0), bead_ratios=(0.5, 0.4, 0.3, 0.25, 0.2, 0.15, 0.1),
            identify_grains=3000, identify_seeds=5, pressures=(5e4, 7e4, 8e4, 9e4), held_out=(6e4,), permutations=9999, sweep=4,
            columns=(10, 20, 40, 80), samples=5000,
        ),
    )
}  # fmt: skip


def size_named(name: str) -> Size:
    """The size of that name; `InputError` for another word."""
    if name not in SIZES:
        raise InputError(f'size = "{name}": is one of {", ".join(SIZES)}')
    return SIZES[name]
