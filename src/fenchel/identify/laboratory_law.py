"""The law fitted to laboratory tests as files: `law.py` for `fenchel drive`, and a path per test.

`law.py` takes the declared law (of the library, or a copy of the law file, `declared_<file>`, beside it) and gives its parameters the
fitted values as defaults, so that it runs without `-p`. A path begins in the virgin state, is compressed isotropically, and then
follows the test.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import isfinite
from pathlib import Path

from .curves import axial
from .laboratory_fit import LaboratoryFit, LaboratoryReplay
from .laboratory_interval import LaboratoryEstimate
from .laboratory_replay import driven_strains, isotropic_compression

__all__ = ["laboratory_files"]

_TEXT = '''"""Law fitted to laboratory tests: {tests}.

{findings}

Drive it:  fenchel drive law.py:law {path}
"""

{imports}

PARAMETERS = (
{parameters}
)

law = load_law({declared}).with_parameters(name="identified", **{{symbol.name: symbol for symbol in PARAMETERS}})
'''


def _parameter(fit: LaboratoryFit, e: LaboratoryEstimate) -> list[str]:
    symbol = next(symbol for symbol in fit.law.parameters if symbol.name == e.name)
    said = e.note or f"{fit.confidence:.0%} interval {e.low:.4g} to {e.high:.4g}, by the {e.source}"
    bounds = "".join(
        f", {word}={value!r}" for word, value in (("lower", symbol.lower), ("upper", symbol.upper)) if isfinite(value)
    )
    text = f'parameter("{e.name}"{bounds}, unit={symbol.unit!r}, default={e.value!r}, note={symbol.note!r})'
    return [f"    # {said}", f"    {text},"]


def _path_text(fit: LaboratoryFit, replay: LaboratoryReplay) -> str:
    """Path file (CSV): virgin state, isotropic compression, then the test; strain along zz, tension positive, SI."""
    before = isotropic_compression(fit.law.compile("3d", tangent=True), fit.values, replay.test.pressure)
    grid, _ = driven_strains(replay.test.axial_strain)
    along = [0.0, *axial(before.eps), *(axial(before.eps)[-1] + grid[1:])]
    if replay.test.drained:
        side = [0.0, *before.sig[:, 0], *[-replay.test.pressure] * (len(grid) - 1)]
        rows = [
            f"{k},{z!r},{x!r},{x!r}" for k, (z, x) in enumerate(zip(map(float, along), map(float, side), strict=True))
        ]
        return "\n".join(["t,eps_zz,sig_xx,sig_yy", *rows]) + "\n"
    volume = before.eps[:, :3].sum(axis=1)
    whole = [0.0, *volume, *[volume[-1]] * (len(grid) - 1)]
    rows = [f"{k},{z!r},{v!r}" for k, (z, v) in enumerate(zip(map(float, along), map(float, whole), strict=True))]
    return "\n".join(["t,eps_zz,eps_v", *rows]) + "\n"


def _path_names(replays: Sequence[LaboratoryReplay]) -> list[str]:
    """A file name per test, each once."""
    out: list[str] = []
    for replay in replays:
        stem = re.sub(r"[^A-Za-z0-9.-]+", "_", replay.test.name).strip("._") or "test"
        name, k = f"path_{stem}.csv", 2
        while name.lower() in (other.lower() for other in out):
            name, k = f"path_{stem}_{k}.csv", k + 1
        out.append(name)
    return out


def laboratory_files(fit: LaboratoryFit, findings: Sequence[str], law_file: Path | None) -> dict[str, str]:
    """Text of `law.py` and of the paths by file name; `law_file` is where a law that is not of the library was declared."""
    names = _path_names(fit.replays)
    rows = [line for e in fit.estimates.values() if e.name in fit.values for line in _parameter(fit, e)]
    out: dict[str, str] = {}
    if law_file is None:
        imports, declared = "from fenchel.potentials import load_law, parameter", repr(fit.law_name)
    else:
        copy = f"declared_{law_file.name}"
        out[copy] = law_file.read_text(encoding="utf-8")
        imports = "from pathlib import Path\n\nfrom fenchel.potentials import load_law, parameter"
        declared = f"str(Path(__file__).with_name({copy!r})) + {':' + fit.law_name.rpartition(':')[2]!r}"
    out["law.py"] = _TEXT.format(
        tests=_safe(", ".join(f"{r.test.name} ({r.test.pressure / 1e3:g} kPa)" for r in fit.replays if not r.held_out)),
        findings=_safe("\n".join(f"* {text}" for text in findings)),
        path=names[0],
        imports=imports,
        parameters="\n".join(rows),
        declared=declared,
    )
    return out | {name: _path_text(fit, replay) for name, replay in zip(names, fit.replays, strict=True)}


def _safe(text: str) -> str:
    """Text that may stand in a docstring: names of samples are free."""
    return text.replace("\\", "/").replace('"""', "'''")
