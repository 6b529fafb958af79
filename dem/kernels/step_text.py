"""The step of a scene: which sweeps it makes, written from the kinds of rows that the scene has and from nothing else."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["STEP_ARGUMENTS", "step_text"]

# names of what each kind hands to its sweep, its warm start and its measures, before the numbers of its law
SWEPT = {
    "pairs": ("vel", "pair", "row"),
    "planes": ("vel", "motion", "wall", "wall_row", "normal", "sense", "dof", "slide"),
    "links": ("vel", "link", "link_row"),
}
WARMED = {
    "pairs": ("vel", "pair", "row"),
    "planes": ("vel", "motion", "wall", "wall_row", "normal", "sense", "dof"),
    "links": ("vel", "link", "link_row"),
}
MEASURED = {
    "pairs": ("before", "vel", "pair", "row", "cold", "step", "theta", "out"),
    "planes": (
        "before", "vel", "motion_before", "motion", "driven", "wall", "wall_row", "wall_cold", "normal", "sense", "dof", "slide",
        "step", "theta", "out",
    ),
    "links": ("before", "vel", "link", "link_row", "theta", "out"),
}  # fmt: skip
STEP_ARGUMENTS = {"solve": SWEPT, "warm": WARMED, "assess": MEASURED}


def step_text(
    modules: Mapping[str, str], scalars: Mapping[str, tuple[str, ...]], threaded: bool
) -> tuple[str, dict[str, tuple[str, ...]]]:
    """The text of the step module, and the names of the arguments of its functions.

    `modules`: name of the generated module of each kind (pairs, planes, links) and of the bodies; `scalars`: the numbers of their laws.
    """
    kinds = [kind for kind in SWEPT if kind in modules]
    lines = [f"from {modules['bodies']} import measure as measure_bodies"]
    for kind in kinds:
        lines += [
            f"from {modules[kind]} import apply as apply_{kind}",
            f"from {modules[kind]} import measure as measure_{kind}",
            f"from {modules[kind]} import sweep as sweep_{kind}",
        ]
    if threaded:
        lines.append(f"from {modules['pairs']} import sweep_parts")

    def numbers(kind: str) -> tuple[str, ...]:
        return tuple(f"{kind}_{name}" for name in scalars.get(kind, ()))

    def join(*groups: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for group in groups for name in group))

    signatures = {
        "warm": join(*(WARMED[k] for k in kinds)) or ("vel",),
        "solve": join(
            *(SWEPT[k] + numbers(k) for k in kinds), ("starts", "part") if threaded else (), ("tolerance", "floor", "sweep_limit")
        ),
        "assess": join(("before", "vel", "free", "mass", "theta", "out"), *(MEASURED[k] + numbers(k) for k in kinds)),
    }  # fmt: skip
    lines += ["", "", "@njit", f"def warm({', '.join(signatures['warm'])}):"]
    lines.append('    """Add the impulses that the rows start from."""')
    for kind in kinds:
        lines.append(f"    apply_{kind}({', '.join(WARMED[kind])})")
    lines += ["", "", "@njit", f"def solve({', '.join(signatures['solve'])}):"]
    lines += [
        '    """Sweep until the relative impulse change of one sweep falls below the tolerance; returns (sweeps, that change)."""',
        "    ratio = np.inf",
        "    done = 0",
        "    while done < sweep_limit:",
        "        change = 0.0",
        "        size = 0.0",
    ]
    for kind in kinds:
        args = list(SWEPT[kind])
        name = f"sweep_{kind}"
        if kind == "pairs" and threaded:
            name, args = "sweep_parts", [*args, "starts", "part"]
        elif kind == "pairs":
            args += ["0", "pair.shape[0]"]
        lines += [
            f"        c, s = {name}({', '.join([*args, *numbers(kind)])})",
            "        change += c",
            "        size += s",
        ]
    lines += [
        "        done += 1",
        "        ratio = np.sqrt(change / max(size, floor * floor)) if floor > 0.0 or size > 0.0 else np.sqrt(change)",
        "        if ratio <= tolerance:",
        "            break",
        "    return done, ratio",
    ]
    lines += ["", "", "@njit", f"def assess({', '.join(signatures['assess'])}):"]
    lines.append(
        '    """Rebuild the velocities from the impulses, `vel` and `motion` being those without, then measure all."""'
    )
    for kind in kinds:
        lines.append(f"    apply_{kind}({', '.join(WARMED[kind])})")
    for kind in kinds:
        lines.append(f"    measure_{kind}({', '.join([*MEASURED[kind], *numbers(kind)])})")
    lines.append("    measure_bodies(before, vel, free, mass, theta, out)")
    return "\n".join(lines) + "\n", signatures
