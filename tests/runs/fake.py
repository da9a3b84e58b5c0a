"""A solver that answers at once: two oscillators, listed in ascending order, with failures on demand.

It reads ``in.txt``: k1, k2 and the number of the point. The folder in FAKE_STATE tells which points fail, and how
(``<point>.<kind>`` with the number of attempts that fail), and counts how often the solver was started.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

from femtune.runs import ExternalSolver, ResultFile, Template, Templates
from femtune.runs.external import Checks

SCRIPT = """
import glob, os, sys, time
state = os.environ["FAKE_STATE"]
k1, k2, point = (float(x) for x in open("in.txt"))
name = "%d" % point
os.close(os.open(state + "/started-" + name + "-" + str(time.time_ns()), os.O_CREAT))
time.sleep(float(os.environ.get("FAKE_S", "0")))
kind = ""
for path in glob.glob(state + "/" + name + ".*"):
    left = int(open(path).read())
    if left:
        kind = path.rsplit(".", 1)[1]
        with open(path, "w") as out:
            out.write(str(left - 1))
if kind == "crash":
    sys.exit(139)
if kind == "hang":
    time.sleep(60)
if kind == "licence":
    print("Error: all tokens are in use")
    sys.exit(3)
if kind == "error":
    print("SEVERE: singular matrix")
if kind == "nothing":
    print("ok")
    sys.exit(0)
modes = sorted([(k1, (1.0, 0.0)), (k2, (0.0, 1.0))])
hz = ["%.12g" % (k ** 0.5 / 6.283185307179586) for k, _ in modes]
if kind == "one":
    hz = hz[:1]
if kind == "descending":
    hz = hz[::-1]
if kind == "nan":
    hz[0] = "nan"
lines = [" ".join(hz)]
lines += ["%d%s %.12g %.12g" % (n + 1, "Z", modes[0][1][n], modes[1][1][n]) for n in (0, 1)]
if kind == "one":
    lines = lines[:1]
if kind != "truncated":
    lines.append("end")
with open("modes.txt", "w") as out:
    out.write("\\n".join(lines) + "\\n")
"""


def fake_solver(folder: Path, **more: object) -> ExternalSolver:
    """The solver, its runs and its state in a folder."""
    state = folder / "state"
    state.mkdir(parents=True, exist_ok=True)
    inputs = Templates((
        Template.of_text("in.txt", "{{k1:.12g}}\n{{k2:.12g}}\n{{point:.12g}}\n"),
        Template.of_text("solve.py", SCRIPT),
    ))  # fmt: skip
    words: dict[str, object] = {
        "timeout_s": 30.0, "checks": Checks(2), "error_texts": ("SEVERE",), "licence_texts": ("tokens are in use",),
        "licence_wait_s": 0.01, "environment": (("FAKE_STATE", str(state)),),
    }  # fmt: skip
    command = (sys.executable, "-I", "-S", "solve.py")
    return ExternalSolver(command, inputs, ResultFile("modes.txt", "table"), folder / "runs", **words | more)  # type: ignore[arg-type]


def fail(folder: Path, point: int, kind: str, times: int) -> None:
    """Let a point fail so many times."""
    (folder / "state" / f"{point}.{kind}").write_text(str(times))


def started(folder: Path) -> int:
    """How often the solver was started."""
    return len(list((folder / "state").glob("started-*")))


def exact_hz(k1: float, k2: float) -> np.ndarray:
    """Frequencies by the closed form."""
    return np.sqrt(np.sort([k1, k2])) / (2.0 * math.pi)
