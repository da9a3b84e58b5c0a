"""femtune: finite element model updating. The words of the command line are functions of `femtune.steps`."""

__version__ = "0.1.0"
