"""fenchel: constitutive laws from declared potentials, and from grains.

The face of the package holds the version only. The rooms are imported by name: `fenchel.potentials`, `fenchel.integrators`,
`fenchel.dem`, `fenchel.identify`.
"""

__version__ = "0.1.0"

__all__ = ["__version__"]
