"""Steps of library laws at 1e5 points, one thread, with tangent, beside copying the same arrays: compare the ratios of one run.

NUMBA_NUM_THREADS=1 python benchmarks/bench_step.py [LAW ...]

A law written as NAME-stress is stepped in the stress formulation, from the stresses of the same strains: from the virgin state, and once
more from states that other strains have left.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from fenchel.potentials.library import ENTRIES, LAWS

COUNT, REPEATS = 100_000, 7


def copied(eps, old):
    """Arrays of a step, written by compiled code that copies what is read."""
    import numba

    out = (
        np.empty_like(eps),
        np.empty_like(old),
        np.empty((len(eps), 36)),
        np.empty(len(eps)),
        np.empty(len(eps), dtype=np.int64),
    )

    @numba.njit(nogil=True)
    def copy(eps, old, stress, new, tangent, loss, status):
        for m in range(eps.shape[0]):
            for i in range(6):
                stress[m, i] = eps[m, i]
            for i in range(old.shape[1]):
                new[m, i] = old[m, i]
            for i in range(6):
                for j in range(6):
                    tangent[m, 6 * i + j] = eps[m, j]
            loss[m] = eps[m, 0]
            status[m] = 0

    copy(eps, old, *out)
    return lambda: copy(eps, old, *out)


def seconds(run):
    """Least processor time of some repeats."""
    found = []
    for _ in range(REPEATS):
        start = time.process_time()
        run()
        found.append(time.process_time() - start)
    return min(found)


def half_plastic(update, base, state, direction, values):
    """Strains base + t·direction, t such that about half of the steps from `state` are plastic."""
    size, low, high = 1e-4, 1e-9, 1e3
    few = None if state is None else {k: v[:2000] for k, v in state.items()}
    for _ in range(40):
        share = (update((base + size * direction)[:2000], few, **values).dissipation > 0).mean()
        if abs(share - 0.5) < 0.02:
            break
        low, high = (size, high) if share < 0.5 else (low, size)
        size = float(np.sqrt(low * high))
    return base + size * direction


def driven_by_stress(name, rng):
    """Print two lines for a law in the stress formulation."""
    from fenchel.integrators.compiled_step import packed_values
    from fenchel.integrators.thermal import thermal_input

    law, entry = LAWS[name], ENTRIES[name]
    strain, update = law.compile(), law.compile(formulation="stress")
    values = dict(entry.values) | dict(entry.worked.temperatures)
    direction = rng.normal(size=(COUNT, 6))
    before = strain(np.linalg.norm(entry.worked.eps) / 2 * rng.normal(size=(COUNT, 6)), None, **values)
    for kind, base, state in (("virgin", np.zeros((COUNT, 6)), None), ("strained", before.strain, before.state)):
        eps = half_plastic(strain, base, state, direction, values)
        sig = strain(eps, state, **values).stress
        heat, rest = thermal_input(law, values, COUNT)
        rows = update.coefficients(packed_values(update, rest), 1.0, heat.temperature)
        old = update.pack(state, COUNT)
        new, found, compliance = np.empty_like(old), np.empty((COUNT, 6)), np.empty((COUNT, 36))
        loss, status = np.empty(COUNT), np.empty(COUNT, dtype=np.int64)
        step = seconds(lambda: update.pointers.run(sig, old, new, found, compliance, True, loss, status, rows))  # noqa: B023
        copy = seconds(copied(eps, old))
        print(
            f"{name + '-stress':22s} {kind:16s} plastic {(loss > 0).mean():.2f}  {COUNT / step / 1e6:6.2f} M/s  "
            f"step/copy {step / copy:6.2f}  copy {COUNT / copy / 1e6:.1f} M/s  strain off by {np.abs(found - eps).max():.1e}"
        )


def main() -> None:
    """Print one line per law."""
    rng = np.random.default_rng(0)
    for name in sys.argv[1:] or [*LAWS, "texsol-stress"]:
        if name.endswith("-stress"):
            driven_by_stress(name.removesuffix("-stress"), rng)
            continue
        law, entry = LAWS[name], ENTRIES[name]
        update = law.compile()
        values = dict(entry.values) | dict(entry.worked.temperatures)
        if update.solver not in ("closed", "reduced", "principal"):
            print(f"{name:22s} {update.solver}")
            continue
        # strains scaled so that about half of the points are plastic
        eps = rng.normal(size=(COUNT, 6))
        scale, low, high = 1e-4, 1e-9, 1e3
        for _ in range(40):
            share = (update(scale * eps[:2000], None, **values).dissipation > 0).mean()
            if abs(share - 0.55) < 0.02 or not law.internal:
                break
            low, high = (scale, high) if share < 0.55 else (low, scale)
            scale = float(np.sqrt(low * high))
        eps *= scale
        pointers = update.pointers
        from fenchel.integrators.compiled_step import packed_values
        from fenchel.integrators.thermal import thermal_input

        heat, rest = thermal_input(law, values, COUNT)
        rows = pointers.coefficients(packed_values(update, rest), 1.0, heat.temperature)
        old = update.pack(None, COUNT)
        new, stress, tangent = np.empty_like(old), np.empty((COUNT, 6)), np.empty((COUNT, 36))
        loss, status = np.empty(COUNT), np.empty(COUNT, dtype=np.int64)
        step = seconds(lambda: pointers.run(eps, old, new, stress, tangent, True, loss, status, rows))  # noqa: B023
        whole = seconds(lambda: update(eps, None, **values))  # noqa: B023
        copy = seconds(copied(eps, old))
        print(
            f"{name:22s} {update.module.METHOD:16s} plastic {(loss > 0).mean():.2f}  {COUNT / step / 1e6:6.2f} M/s  "
            f"step/copy {step / copy:6.2f}  call/copy {whole / copy:6.2f}  copy {COUNT / copy / 1e6:.1f} M/s"
        )


if __name__ == "__main__":
    main()
