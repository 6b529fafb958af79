r"""Extended-XYZ files that OVITO opens: one line per body, one block per instant.

The second line of a block names the columns: species (grain, bead or fixed), position [m], radius [m], velocity [m/s], id, wire (−1: no
bead), rank and contacts; the box stands there as `Lattice` and `Origin`, the time as `Time` [s]. A sample without box has no lattice.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..measures import Network
from ..storage import replace_file

__all__ = ["write_extended_xyz"]

_COLUMNS = "species:S:1:pos:R:3:radius:R:1:velo:R:3:id:I:1:wire:I:1:rank:I:1:contacts:I:1"


def _block(network: Network) -> str:
    n, d = network.x.shape
    space = np.zeros((n, 3))
    space[:, :d] = network.x
    velocity = np.zeros((n, 3))
    velocity[:, :d] = network.velocity
    ends = np.concatenate([network.pair.ravel(), network.wall[:, 0]])
    contacts = np.bincount(ends, minlength=n)
    species = np.where(network.fixed, "fixed", np.where(network.is_bead, "bead", "grain"))
    head = f'Properties={_COLUMNS} Time={network.time!r} pbc="F F F" unit="m s"'
    if np.all(np.isfinite(network.half)):
        # a plane sample lies in a box as thick as its largest disk
        half = np.append(network.half, [] if d == 3 else [network.radius.max()])
        head = f'Lattice="{_numbers(np.diag(2.0 * half).ravel())}" Origin="{_numbers(-half)}" ' + head
    rows = [
        f"{species[k]} {_numbers(space[k])} {network.radius[k]:.17g} {_numbers(velocity[k])} "
        f"{k + 1} {network.wire[k]} {network.rank[k]} {contacts[k]}"
        for k in range(n)
    ]
    return "\n".join([str(n), head, *rows, ""])


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{value:.17g}" for value in values)


def write_extended_xyz(networks: Network | Iterable[Network], path: Path | str) -> Path:
    """Write one instant or several to one file, which is replaced as a whole; `StorageError` when it cannot be written."""
    instants = [networks] if isinstance(networks, Network) else networks
    replace_file(path, "".join(_block(network) for network in instants).encode())
    return Path(path)
