"""What every command pays before it does anything."""

import subprocess
import sys


def test_import_the_face(benchmark):
    benchmark(subprocess.run, [sys.executable, "-c", "import fenchel.cli"], check=True)


def test_import_nothing(benchmark):
    """The interpreter alone, to subtract."""
    benchmark(subprocess.run, [sys.executable, "-c", ""], check=True)
