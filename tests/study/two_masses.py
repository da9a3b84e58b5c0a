"""Two masses on springs whose modes change places, solved by a script in the place of an external solver."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import femtune as ft
from femtune.dofs import DofSet
from femtune.modal import ModeSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

# two masses of 1 kg on springs k1 and k2 to ground, coupled by a weak spring: their modes change places at k1 = k2;
# the frequencies are rounded to seven digits, as those of a listing
SCRIPT = """
import math, os, sys, time
k1, k2 = (float(x) for x in open("in.txt"))
state = os.environ["FAKE_STATE"]
os.close(os.open("%s/started-%d" % (state, time.time_ns()), os.O_CREAT))
time.sleep(0.1 * os.path.exists(state + "/slow"))
if os.environ.get("FAKE_ONCE") and not os.path.exists("%s/%r-%r" % (state, k1, k2)):
    open("%s/%r-%r" % (state, k1, k2), "w").close()
    sys.exit(1)
if k1 > float(os.environ.get("FAKE_ABOVE", "inf")):
    sys.exit(2)
c = 10.0
a, b = k1 + c, k2 + c
mean, half = 0.5 * (a + b), math.hypot(0.5 * (a - b), c)
angle = 0.5 * math.atan2(-2.0 * c, a - b)
low, high = (-math.sin(angle), math.cos(angle)), (math.cos(angle), math.sin(angle))
with open("modes.txt", "w") as out:
    out.write(" ".join("%.6e" % (math.sqrt(v) / (2 * math.pi)) for v in (mean - half, mean + half)) + "\\n")
    for i in (0, 1):
        out.write("%dZ %.6e %.6e\\n" % (i + 1, low[i], high[i]))
    out.write("end\\n")
"""
STUDY = """[study]
title = "Two masses"
units = "m-kg-s"

[modes]
count = 2

[solver]
command = {command}
templates = ["in.txt"]
files = ["solve.py"]
result = "modes.txt"
format = "table"
environment = {{ {environment} }}

[sensors]
by_id = true

[test]
file = "test.uff"

[[parameter]]
name = "k1"
absolute = true
nominal = 800.0
lower = 500.0
upper = 1500.0

[[parameter]]
name = "k2"
absolute = true
lower = 500.0
upper = 1500.0

[residuals]
frequency_sd = 0.001
shape_sd = 0.01
"""
TRUTH = np.array([1210.0, 940.0])


def exact(k1: float, k2: float) -> tuple[np.ndarray, np.ndarray]:
    values, shapes = np.linalg.eigh(np.array([[k1 + 10.0, -10.0], [-10.0, k2 + 10.0]]))
    return np.sqrt(values) / (2 * np.pi), shapes


def prepared(folder: Path) -> Path:
    """The study and its files, with the modes of the truth as test: the modes change places on the way to them."""
    (folder / "state").mkdir()
    (folder / "in.txt").write_text("{{k1}}\n{{k2}}\n")
    (folder / "solve.py").write_text(SCRIPT)
    ft.write_test(of_both_masses(exact(*TRUTH)), folder / "test.uff")
    return write_study(folder)


def of_both_masses(modes: tuple[np.ndarray, np.ndarray], name: str = "two masses") -> ModalTest:
    """A test of both masses."""
    frame = WireFrame(np.array([1, 2]), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    return ModalTest(name, SI, frame, modes=ModeSet(*modes, DofSet.parse(["1Z+", "2Z+"])))


def write_study(folder: Path, **environment: str) -> Path:
    """The study file, with further variables for the script."""
    variables = {"FAKE_STATE": str(folder / "state"), **environment}
    text = ", ".join(f'{name} = "{value}"' for name, value in variables.items())
    command = str([sys.executable, "-I", "-S", "solve.py"]).replace("'", '"')
    (folder / "study.toml").write_text(STUDY.format(command=command, environment=text))
    return folder / "study.toml"


def started(study: Path) -> int:
    return len(list((study.parent / "state").glob("started-*")))


def values(result: object) -> np.ndarray:
    table = result.parameters  # type: ignore[attr-defined]
    found = dict(zip(table.column("name"), table.column("value")))
    return np.array([found["k1"], found["k2"]])
