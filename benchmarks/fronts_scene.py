"""What comes with the package about scenes: fronts of random triaxial scenes -> src/fenchel/fronts/scene.json.

python benchmarks/fronts_scene.py FIRST LAST OUT.json

Seeds FIRST ... LAST of tests/random_scenes.py, every step and tolerance below, judged by the deviator along the path
(`fenchel.tradeoff.scene`).
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from random_scenes import random_scene

from fenchel.dem.accuracy import features
from fenchel.errors import FenchelError
from fenchel.front import environment
from fenchel.tradeoff.scene import measure_scene

STEPS = (0.025, 0.05, 0.1, 0.2)
TOLERANCES = (1e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3)


def rounded(value: float | None) -> float | None:
    """Three digits: more would be noise."""
    return None if value is None else float(f"{value:.3g}")


def main(first: int, last: int, out: Path) -> None:
    scenes = []
    settings = [{"step": step, "tolerance": tolerance} for step in STEPS for tolerance in TOLERANCES]
    for seed in range(first, last):
        scene = random_scene(seed)
        with tempfile.TemporaryDirectory() as folder:
            try:
                front = measure_scene(scene, Path(folder), steps=STEPS, tolerances=TOLERANCES, jobs=1, show=False)
            except FenchelError as problem:
                print(seed, problem, flush=True)
                continue
        points = {(p.setting["step"], p.setting["tolerance"]): p for p in front.points if "law" not in p.setting}
        own = [points[s["step"], s["tolerance"]] for s in settings]
        scenes.append(
            {
                "seed": seed,
                "features": {k: rounded(v) for k, v in features(scene).items()},
                "errors": [rounded(p.error) for p in own],
                "seconds": [None if p.error is None else rounded(p.cost) for p in own],
                "residuals": [rounded(p.figures.get("residual")) for p in own],
                "iterations": [rounded(p.figures.get("iterations")) for p in own],
            }
        )
        print(seed, front.note, flush=True)
        content = {"measure": front.measure, "settings": settings, "environment": environment(), "scenes": scenes}
        out.write_text(json.dumps(content, indent=None, separators=(",", ":")).replace('{"seed"', '\n{"seed"') + "\n")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
