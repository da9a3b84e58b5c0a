"""The studies of a story: a chain of two masses, solved by a program of its own, or a beam that femtune solves itself.

The program fails on demand: `FAULTS` says how. It writes a line into a log for every run that it begins and ends, so
that the runs that were made are known without femtune.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femtune.dofs import DofSet
from femtune.files.uff import write_uff_modes
from femtune.modal import ModeSet
from femtune.testdata import ModalTest, WireFrame
from femtune.testing import example_deck, example_test
from femtune.units import SI

FAULTS = ("crash", "hang", "cut", "nothing", "zero", "nan", "text", "folder", "child", "link")
"""Ways in which a run of the solver fails: it crashes; hangs; leaves a part of its result; ends as if all were well
without a result, with an empty one, or with numbers that are none; says that it failed; removes its folder; leaves a
process in a session of its own; puts a link in place of its result."""
RETRIES = 2
"""How often a run is tried again; a point fails no more often than that."""
TIMEOUT_S = 8.0
"""After which a run of the solver is ended; runs take a twentieth of a second on a quiet machine."""

SOLVER = """import math, os, sys
MASS = {mass}
state = os.environ.get("STORY_STATE", "")
d = dict((a, float(b)) for a, b in (line.split() for line in open("model.inp") if len(line.split()) == 2))
k1, k2, k3 = d["k1"], d["k2"], d["k3"]
a, b, c = k1 + k2, k2, k2 + k3
root = math.sqrt((a - c) ** 2 / 4 + b * b)
w = [((a + c) / 2 - root) / MASS, ((a + c) / 2 + root) / MASS]
hz = [repr(math.sqrt(x) / 2 / math.pi) for x in w]
point = "%r_%r_%r_%r" % (k1, k2, k3, MASS)

def log(word):
    with open(os.path.join(state, "log"), "a") as out:
        out.write(word + " " + point + " " + " ".join(hz) + chr(10))

fault = ""
if state:
    log("begin")
    try:
        faults = open(os.path.join(state, "faults")).read().split()
    except OSError:
        faults = []
    seed = sum(ord(one) * (7 * i + 3) for i, one in enumerate(point))
    for number in range({retries}):
        # a name that appears once: each point fails a few times at most, whoever asks for it
        try:
            os.close(os.open(os.path.join(state, "tried_%s_%d" % (point, number)), os.O_CREAT | os.O_EXCL))
        except OSError:
            continue
        chosen = seed + 5 * number
        fault = faults[chosen % len(faults)] if faults and chosen % 3 == 0 else ""
        break
if fault == "crash":
    os.abort()
if fault == "hang":
    import time
    time.sleep(600)
if fault == "text":
    print("SEVERE: no solution")
if fault == "nothing":
    sys.exit(0)
if fault == "folder":
    import shutil
    shutil.rmtree(os.getcwd())
    sys.exit(0)
if fault == "child":
    import subprocess
    subprocess.Popen([sys.executable, "-I", "-S", "-c", "import os, time; os.setsid(); time.sleep(600)"])
lines = [" ".join(hz)]
for node, pair in ((1, [b, b]), (2, [a - MASS * x for x in w])):
    shape = [v / math.sqrt(MASS * (b * b + (a - MASS * x) ** 2)) for v, x in zip(pair, w)]
    lines.append(str(node) + "X+ " + " ".join(map(repr, shape)))
lines.append("end")
content = chr(10).join(lines) + chr(10)
if fault == "cut":
    content = content[: len(content) * 2 // 3]
if fault == "zero":
    content = ""
if fault == "nan":
    content = content.replace(hz[0], "nan")
if fault == "link":
    os.symlink("/etc/hostname", "result.txt")
    sys.exit(0)
with open("result.txt", "w") as out:
    out.write(content)
if state and fault in ("", "child"):
    log("end")
if fault == "child":
    import time
    time.sleep(0.05)
"""
_PYTHON = os.path.realpath(sys.executable)
"""Not the program of an environment or a launcher on the path, which would take longer than the solver."""
TEMPLATE = "k1 {{k1}}\nk2 {{k2}}\nk3 %r\n"
GRID = "GRID,1,,1.,0.,0.\nGRID,2,,2.,0.,0.\n"
STUDY = """[study]
title = "{title}"
units = "m-kg-s"
[model]
grid = "grid.bdf"
[modes]
count = 2
[solver]
command = ["{python}", "-I", "-S", "{script}"]
templates = ["model.inp"]
files = [{files}]
result = "result.txt"
format = "table"
error_texts = ["SEVERE"]
retries = {retries}
timeout_s = {timeout}
[test]
file = "chain.uff"
[output]
folder = "{folder}"
[[parameter]]
name = "k1"
absolute = true
nominal = 2000.0
lower = 500.0
upper = 4000.0
[[parameter]]
name = "k2"
absolute = true
nominal = 2000.0
lower = 500.0
upper = 4000.0
[residuals]
frequency_sd = 0.01
shape_sd = 0.05
"""
BEAM = """[study]
title = "beam"
deck = "cantilever.bdf"
units = "m-kg-s"
[modes]
count = 4
[test]
file = "cantilever.uff"
[output]
folder = "{folder}"
[[parameter]]
name = "I2"
fields = ["PBAR 1 I2"]
lower = 0.7
upper = 1.3
[[parameter]]
name = "I1"
fields = ["PBAR 1 I1"]
lower = 0.7
upper = 1.3
[residuals]
frequency_sd = {sd}
[update]
starts = 3
"""


@dataclass(frozen=True)
class Variant:
    """State of the inputs of a study: mass in the solver's script, spring in its template, frequencies of the test."""

    mass: float = 1.0
    spring: float = 100.0
    test: float = 1.0


@dataclass(frozen=True)
class Kind:
    """One kind of study.

    Parameters
    ----------
    name : of the study file, without its ending
    command : the words before the study file
    solver : whether a program is run
    copied : whether its script is copied into the folders of the runs; else it is named by its path
    """

    name: str
    command: str
    solver: bool = True
    copied: bool = True


KINDS = (Kind("copied", "update"), Kind("named", "update", copied=False), Kind("beam", "update", solver=False))


def write_inputs(folder: Path, kind: Kind, variant: Variant, output: str) -> dict[str, bytes]:
    """Write the files of a study; their contents by name."""
    files = _chain(folder, kind, variant, output) if kind.solver else _beam(folder, kind, variant, output)
    for name, content in files.items():
        if not (folder / name).exists() or (folder / name).read_bytes() != content:
            (folder / name).write_bytes(content)
    return files


def _chain(folder: Path, kind: Kind, variant: Variant, output: str) -> dict[str, bytes]:
    script = "solve.py" if kind.copied else "../../../solve_named.py"
    study = STUDY.format(
        title=kind.name, python=_PYTHON, script=script, files='"solve.py"' if kind.copied else "", retries=RETRIES,
        timeout=TIMEOUT_S, folder=output,
    )  # fmt: skip
    return {
        f"{kind.name}.toml": study.encode(),
        "grid.bdf": GRID.encode(),
        "model.inp": (TEMPLATE % variant.spring).encode(),
        script.rpartition("/")[2]: SOLVER.format(mass=variant.mass, retries=RETRIES).encode(),
        "chain.uff": _test(folder, variant),
    }


def _test(folder: Path, variant: Variant) -> bytes:
    a, b, c = 1500.0 + 2600.0, 2600.0, 2700.0
    values, shapes = np.linalg.eigh(np.array([[a, -b], [-b, c]]))
    modes = ModeSet(variant.test * np.sqrt(values) / (2.0 * math.pi), shapes, DofSet.parse(["1X+", "2X+"]))
    places = WireFrame(np.array([1, 2]), np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]))
    path = folder / ".test.uff"
    write_uff_modes(path, ModalTest("chain", SI, geometry=places, modes=modes))
    content = path.read_bytes()
    path.unlink()
    return content


def _beam(folder: Path, kind: Kind, variant: Variant, output: str) -> dict[str, bytes]:
    made = folder / ".beam"
    made.mkdir()
    example_deck(made), example_test(made)
    files = {path.name: path.read_bytes() for path in made.iterdir()}
    for path in made.iterdir():
        path.unlink()
    made.rmdir()
    return {**files, f"{kind.name}.toml": BEAM.format(folder=output, sd=0.01 * variant.test).encode()}


_OF_THE_WAY = ("history", "iteration", "message")
"""Entries of the update that tell how its result was reached; a run that continues begins where another ended."""


def numbers(folder: Path) -> Mapping[str, object]:
    """The numbers of a run: parameters with their intervals, modes, residuals."""
    found = json.loads((folder / "results.json").read_bytes())
    update = {key: value for key, value in found["update"].items() if key not in _OF_THE_WAY}
    return {"parameters": found["parameters"], "modes": found["modes"], "update": update}
