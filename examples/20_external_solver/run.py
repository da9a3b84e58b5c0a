"""Update a frame in CalculiX from outside: python run.py [--quick] [--evidence DIR].

A frame of two columns and a beam is known to femtune as an input file of CalculiX with placeholders only. Its
"measured" modes are those of the same file with other moduli and another density. The study finds these values with
runs of CalculiX alone. CalculiX (`ccx`) is searched for on the path, or taken from $FEMTUNE_CALCULIX; without it the
example reports this and ends.
"""

from __future__ import annotations

import argparse
import os
import shutil
import tempfile
from pathlib import Path

import numpy as np

import femtune as ft
from femtune.dofs import DofSet
from femtune.journal.runs import open_run_journal
from femtune.modal import ModeSet
from femtune.runs import ExternalSolver, ResultFile, Templates, read_template
from femtune.testdata import ModalTest, WireFrame
from femtune.units import unit_system

_TRUE = {"columns": 1.95e11, "beam": 2.21e11, "density": 8150.0}
_NOMINAL = {"columns": 2.1e11, "beam": 2.1e11, "density": 7850.0}
_BOUNDS = {"columns": (1.6e11, 2.5e11), "beam": (1.6e11, 2.5e11), "density": (7000.0, 9000.0)}
_THREADS = (("OMP_NUM_THREADS", "1"),)
_MODES, _COMPARED = 8, 5


def template(n: int) -> str:
    """A portal of beams with n elements a side: columns of 1.2 m, a beam of 1 m, feet clamped."""
    k = 2 * n
    left = [(0.0, 1.2 * i / k) for i in range(k + 1)]
    top = [(1.0 * i / k, 1.2) for i in range(1, k + 1)]
    right = [(1.0, 1.2 * (k - i) / k) for i in range(1, k + 1)]
    points = [*left, *top, *right]
    lines = ["*NODE, NSET=NALL", *(f"{i},{x:.6f},0.,{z:.6f}" for i, (x, z) in enumerate(points, start=1))]
    for name, first in (("LEFT", 0), ("TOP", 1), ("RIGHT", 2)):
        lines.append(f"*ELEMENT, TYPE=B32R, ELSET={name}")
        for e in range(n):
            at = first * k + 2 * e + 1
            lines.append(f"{first * n + e + 1},{at},{at + 1},{at + 2}")
    lines += ["*ELSET, ELSET=COLUMNS", "LEFT,RIGHT"]
    for name, elements in (("columns", "COLUMNS"), ("beam", "TOP")):
        lines += [
            f"*MATERIAL, NAME={name.upper()}",
            "*ELASTIC",
            f"{{{{{name}:.6e}}}},.3",
            "*DENSITY",
            "{{density:.6e}}",
        ]
        lines += [f"*BEAM SECTION, ELSET={elements}, MATERIAL={name.upper()}, SECTION=RECT", ".03,.02", "0.,1.,0."]
    lines += ["*BOUNDARY", "1,1,6", f"{len(points)},1,6", "*STEP", "*FREQUENCY", str(_MODES)]
    return "\n".join([*lines, "*NODE FILE, OUTPUT=2D", "U", "*END STEP", ""])


def study(program: str) -> str:
    """The study file."""
    parameters = "".join(
        f'[[parameter]]\nname = "{name}"\nabsolute = true\nnominal = {_NOMINAL[name]}\n'
        f"lower = {low}\nupper = {high}\n\n"
        for name, (low, high) in _BOUNDS.items()
    )
    return f"""[study]
title = "Frame in CalculiX"
units = "m-kg-s"

[model]
grid = "frame.inp"

[modes]
count = {_MODES}

[solver]
command = ["{program}", "frame"]
templates = ["frame.inp"]
result = "frame.frd"
format = "calculix-frd"
environment = {{ OMP_NUM_THREADS = "1" }}

[test]
file = "frame.uff"

{parameters}[residuals]
frequency_sd = 0.002

[[residual]]
kind = "shape"
scaling = "mass"
mass_scaled = true
sd = 0.02
"""


def measure(program: str, folder: Path, n: int) -> None:
    """The modes at the true values, at the quarters of the columns and of the beam, as a Universal File."""
    inputs = Templates((read_template(folder / "frame.inp"),))
    result = ResultFile("frame.frd", "calculix-frd")
    found = ExternalSolver((program, "frame"), inputs, result, folder / "truth", environment=_THREADS).run(_TRUE)
    if found.modes is None:
        raise SystemExit(f"CalculiX failed: {found.failures[-1]}")
    nodes = np.array([1 + round(part * 2 * n) for part in (0.5, 1.0, 1.5, 2.0, 2.5)])
    at = np.searchsorted(found.modes.nodes, nodes)
    dofs = DofSet.parse([f"{node}{direction}+" for node in nodes for direction in "XYZ"])
    shapes = found.modes.shapes[at, :3, :_COMPARED].reshape(-1, _COMPARED)
    places = {int(line.split(",")[0]): line.split(",")[1:] for line in template(n).splitlines()[1 : 6 * n + 2]}
    frame = WireFrame(nodes, np.array([[float(x) for x in places[int(node)]] for node in nodes]))
    modes = ModeSet(found.modes.freq_hz[:_COMPARED], shapes, dofs)
    ft.write_test(ModalTest("frame", unit_system("m-kg-s"), frame, modes=modes), folder / "frame.uff")


def page(result: ft.RunResult, states: dict[str, int]) -> str:
    """What was found, as Markdown."""
    table = result.parameters
    found = dict(zip(table.column("name"), table.column("value")))
    rows = []
    for name, value in found.items():
        error = f"{100 * (value / _TRUE[name] - 1):+.0e} %"
        rows.append(f"| {name} | {_NOMINAL[name]:.4g} | {_TRUE[name]:.4g} | {value:.6g} | {error} |")
    runs = ", ".join(f"{count} {state}" for state, count in states.items())
    return "\n".join(
        [
            "# A frame in CalculiX, updated from outside",
            "",
            "Three parameters of an input file of CalculiX, found with runs of CalculiX alone; the test has five modes",
            "of the same file at the true values, to the six digits of the .frd file.",
            "",
            "| parameter | initial | true | found | error |",
            "| --- | ---: | ---: | ---: | ---: |",
            *rows,
            "",
            f"Runs in the journal: {runs}.",
            "",
        ]
    )


def main() -> None:
    """Run the example and check its numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer elements")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    asked = parser.parse_args()
    program = os.environ.get("FEMTUNE_CALCULIX") or shutil.which("ccx")
    if program is None:
        print("skipped: CalculiX (ccx) is not here")
        return
    n = 4 if asked.quick else 8
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "frame.inp").write_text(template(n))
        measure(program, folder, n)
        (folder / "study.toml").write_text(study(program))
        result = ft.run(folder / "study.toml")
        journal = open_run_journal(folder / "run")
        text = page(result, journal.states())
        journal.close()
    print(text)
    found = dict(zip(result.parameters.column("name"), result.parameters.column("value")))
    for key, true in _TRUE.items():
        assert abs(found[key] / true - 1.0) < 1e-3, (key, found[key], true)
    if asked.evidence:
        (asked.evidence / "20_external_solver.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
