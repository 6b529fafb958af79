"""Where the time goes until a law answers for the first time: cold (an empty cache) and from the cache, each in its own process.

python benchmarks/bench_compile.py [LAW]
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

SPLIT = """
import sys, time
clock = time.process_time if sys.argv[2] == "processor" else time.perf_counter
marks = [("start", clock())]
def mark(what):
    marks.append((what, clock()))
import numba
numba.njit("float64(float64)")(lambda x: x + 1.0)
mark("numba's own start (a trivial function)")
from fenchel.potentials.library import ENTRIES
mark("import of potentials and library")
import fenchel.integrators
mark("import of integrators")
entry = ENTRIES[sys.argv[1]]
values = dict(entry.values) | dict(entry.worked.temperatures)
from fenchel.integrators.closed import closed_module
closed_module(entry.law)
mark("derivation and text")
update = entry.law.compile()
mark("text from the cache or written, module imported")
pointers = update.pointers
mark("compiled step, method and functions")
import numpy as np
strain = np.array([1e-3, 0, -2e-3, 0, 0, 1e-4])
update(strain, None, **values)
mark("first call")
update.energy(strain, None, **values)
mark("energy_ compiled and called")
from fenchel.integrators import drive_arrays
drive_arrays(update, [False] * 6, strain[None], values)
mark("path loop compiled and called")
for (_, before), (what, now) in zip(marks, marks[1:]):
    print(f"    {now - before:7.3f} s  {what}")
print(f"    {dict(marks)['first call'] - marks[3][1]:7.3f} s  all from the declared law to its first answer")
"""


def main() -> None:
    """Print the split."""
    law = sys.argv[1] if len(sys.argv) > 1 else "texsol"
    with tempfile.TemporaryDirectory() as folder:
        for what in ("cold", "cached"):
            print(f"{law}, {what} (processor time):")
            environment = os.environ | {"FENCHEL_CACHE": folder, "NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
            subprocess.run([sys.executable, "-c", SPLIT, law, "processor"], check=True, env=environment)


if __name__ == "__main__":
    main()
