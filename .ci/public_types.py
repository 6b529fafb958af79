"""How much of the public surface has a known type, by what `pyright --verifytypes` says: `python .ci/public_types.py < REPORT.json`.

The surface is every name in `__all__` of the rooms below, with the members of its classes. Laws are sympy objects, and sympy tells no
types, so whatever names a law counts as unknown; nothing else may, and no type may be left to inference.
"""

import importlib
import json
import sys

ROOMS = (
    "fenchel",
    "fenchel.campaign",
    "fenchel.dem",
    "fenchel.identify",
    "fenchel.integrators",
    "fenchel.potentials",
    "fenchel.potentials.library",
)
LAWS = ("fenchel.potentials.", "fenchel.integrators.")  # where a law is named
LEAST = 0.92


def public_names() -> set[str]:
    """Full names of the surface: where a name is listed, and where it is defined."""
    names = set()
    for room in ROOMS:
        module = importlib.import_module(room)
        for name in module.__all__:
            names.add(f"{room}.{name}")
            home = getattr(getattr(module, name), "__module__", None) or room
            if home.startswith("fenchel"):
                names.add(f"{home}.{name}")
    return names


def main() -> int:
    """Print the share; 1 when it fell, or where something that names no law is unknown."""
    names, report = public_names(), json.load(sys.stdin)
    found = []
    for symbol in report["typeCompleteness"]["symbols"]:
        parts = symbol["name"].split(".")
        if any(".".join(parts[:k]) in names for k in range(2, len(parts) + 1)):
            found.append(symbol)
    unknown = [symbol for symbol in found if not symbol["isTypeKnown"]]
    share = 1.0 - len(unknown) / max(len(found), 1)
    wrong = [s for s in unknown if s["isTypeAmbiguous"] or not s["name"].startswith(LAWS)]
    print(f"public types: {len(found) - len(unknown)} of {len(found)} known ({share:.1%}); the others name a law")
    for symbol in wrong:
        said = "; ".join(entry["message"].replace("\n", " ") for entry in symbol["diagnostics"])
        print(f"  {symbol['name']}: {said or 'partially unknown'}")
    if len(found) < 1000:
        print("  fewer than a thousand names were seen: did pyright find the package?")
    return int(bool(wrong) or share < LEAST or len(found) < 1000)


if __name__ == "__main__":
    sys.exit(main())
