"""The command is in the help and answers, and a wrong word ends in a message with its code."""

import subprocess
import sys
from pathlib import Path

import femtune as ft

assert Path(ft.__file__).parent == Path(sys.argv[1])


def said(*words: str) -> tuple[int, str]:
    """Exit code and output of a command."""
    done = subprocess.run([sys.executable, "-m", "femtune", *words], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


assert "  units " in said("--help")[1]
assert said("units", "mm-t-s") == (0, "1 N\n")
code, text = said("units", "mm-t")
assert code == 2
assert "[units." in text
