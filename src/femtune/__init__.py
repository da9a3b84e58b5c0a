"""femtune: finite element model updating."""

__version__ = "0.1.0"
