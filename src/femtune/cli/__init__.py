"""The command line: one command a step, in the order an engineer does them."""

from femtune.cli.commands import main

__all__ = ["main"]
