"""A frame of two storeys, with feet at two levels, as a template of CalculiX and as a deck.

CalculiX has quadratic beams, which yield in shear; the bars of the deck do not. The deck may also have errors.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

import femtune as ft
from femtune.dofs import DofSet
from femtune.files.modes.read import read_modes
from femtune.modal import ModeSet
from femtune.runs.process import begun, run_process
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

WIDTH, STOREY, DENSITY = 1.0, 0.8, 7850.0
ALONG_Y, ACROSS = 0.05, 0.08
"""Section: along y, and in the plane of the frame, x and z."""
NOMINAL, BOUNDS = 2.1e11, (1.5e11, 2.7e11)
TRUE = {"left": 1.86e11, "right": 2.05e11, "beam": 2.35e11, "upper": 2.2e11, "roof": 1.8e11}
"""Moduli of elasticity of the lower columns, the lower beam, both upper columns and the roof beam."""
MODES, CELLS, NOISE = 8, 8, 0.002
"""Modes; distances between nodes in a member, two an element of CalculiX and one a bar; noise of the frequencies."""
_AT = {"A": (0.0, 0.0), "B": (0.0, STOREY), "C": (WIDTH, STOREY), "D": (WIDTH, -0.3), "E": (0.0, 2.0 * STOREY),
       "F": (WIDTH, 2.0 * STOREY)}  # fmt: skip
_MEMBERS = (("AB", "left"), ("DC", "right"), ("BC", "beam"), ("BE", "upper"), ("CF", "upper"), ("EF", "roof"))


@dataclass(frozen=True, eq=False)
class _Mesh:
    """Coordinates (n, 3), and a row of nodes (from 1) of each member."""

    places: np.ndarray
    rows: tuple[tuple[int, ...], ...]


def _mesh() -> _Mesh:
    known: dict[tuple[float, float], int] = {}
    rows = []
    for ends, _ in _MEMBERS:
        line = np.round(np.linspace(_AT[ends[0]], _AT[ends[1]], CELLS + 1), 9)
        rows.append(tuple(known.setdefault((float(x), float(z)), len(known) + 1) for x, z in line))
    places = np.array([(x, 0.0, z) for x, z in known])
    return _Mesh(places, tuple(rows))


def template() -> str:
    """The input of CalculiX, quadratic beams, with a placeholder for each modulus."""
    mesh, lines = _mesh(), ["*NODE, NSET=NALL"]
    lines += [f"{i},{x:.9g},{y:.9g},{z:.9g}" for i, (x, y, z) in enumerate(mesh.places, start=1)]
    number = 0
    for part in TRUE:
        lines.append(f"*ELEMENT, TYPE=B32R, ELSET={part}")
        for (_, own), row in zip(_MEMBERS, mesh.rows, strict=True):
            for i in range(0, CELLS if own == part else 0, 2):
                number += 1
                lines.append(f"{number},{row[i]},{row[i + 1]},{row[i + 2]}")
        lines += [f"*MATERIAL, NAME={part}", "*ELASTIC", f"{{{{{part}:.9e}}}},.3", "*DENSITY", f"{DENSITY}"]
        lines += [f"*BEAM SECTION, ELSET={part}, MATERIAL={part}, SECTION=RECT", f"{ALONG_Y},{ACROSS}", "0.,1.,0."]
    lines += ["*BOUNDARY", *(f"{mesh.rows[i][0]},1,6" for i in (0, 1))]
    return "\n".join([*lines, "*STEP", "*FREQUENCY", f"{MODES}", "*NODE FILE, OUTPUT=2D", "U", "*END STEP", ""])


@dataclass(frozen=True)
class DeckErrors:
    """Errors of the deck.

    Parameters
    ----------
    height : of all sections over the true one
    inertia : moments of inertia of parts over those of their sections
    """

    height: float = 1.0
    inertia: Mapping[str, float] = field(default_factory=dict)


def deck(errors: DeckErrors) -> str:
    """The deck: bars without shear deformation."""
    mesh, height = _mesh(), errors.height * ACROSS
    lines = ["SOL 103", "CEND", "SPC = 1", "METHOD = 1", "BEGIN BULK", "PARAM,COUPMASS,1", f"EIGRL,1,,,{MODES}"]
    lines += [f"GRID,{i},,{x:.6f},{y:.1f},{z:.6f}" for i, (x, y, z) in enumerate(mesh.places, start=1)]
    in_plane, out = ALONG_Y * height**3 / 12.0, height * ALONG_Y**3 / 12.0
    number = 0
    for m, part in enumerate(TRUE, start=1):
        lines += [f"MAT1,{m},{NOMINAL:.4e},,.3,{DENSITY}".replace("e+", "+")]
        stiff = errors.inertia.get(part, 1.0) * np.array([out, in_plane, 2.45 * out])
        lines += [f"PBAR,{m},{m},{ALONG_Y * height:.4e},{stiff[0]:.4e},{stiff[1]:.4e},{stiff[2]:.4e}"]
        for (_, own), row in zip(_MEMBERS, mesh.rows, strict=True):
            for a, b in pairwise(row) if own == part else ():
                number += 1
                lines.append(f"CBAR,{number},{m},{a},{b},0.,1.,0.")
    lines += [f"SPC1,1,123456,{mesh.rows[i][0]}" for i in (0, 1)]
    return "\n".join([*lines, "ENDDATA", ""])


def calculix() -> str | None:
    """The program; None where it is not installed."""
    return os.environ.get("FEMTUNE_CALCULIX") or shutil.which("ccx")


def measure(folder: Path, program: str) -> None:
    """Write frame.inp, and frame.uff from CalculiX with noise."""
    truth = folder / "truth"
    truth.mkdir(parents=True)
    text = template()
    (folder / "frame.inp").write_text(text)
    for name, value in TRUE.items():
        text = text.replace(f"{{{{{name}:.9e}}}}", f"{value:.9e}")
    (truth / "frame.inp").write_text(text)
    if run_process((program, "frame"), truth, 60.0, {"OMP_NUM_THREADS": "1"}, begun()) != 0:
        raise SystemExit("CalculiX failed with the frame at the true values")
    modes = read_modes(truth / "frame.frd", "calculix-frd")
    mesh = _mesh()
    nodes = sorted({node for row in mesh.rows for node in row[::2]} - {row[0] for row in mesh.rows[:2]})
    shapes = modes.shapes[np.searchsorted(modes.nodes, nodes)][:, :3].reshape(3 * len(nodes), -1)
    hz = modes.freq_hz * (1.0 + NOISE * np.random.default_rng(3).standard_normal(len(modes.freq_hz)))
    dofs = DofSet.parse([f"{n}{c}+" for n in nodes for c in "XYZ"])
    frame = WireFrame(np.array(nodes), mesh.places[np.array(nodes) - 1])
    ft.write_test(ModalTest("frame", SI, frame, modes=ModeSet(hz, shapes, dofs)), folder / "frame.uff")


def study(program: str, with_deck: bool) -> str:
    """The study file; `with_deck` takes derivatives of the deck frame.bdf."""
    source = 'deck = "frame.bdf"' if with_deck else ""
    derivatives = 'derivatives = "deck"' if with_deck else ""
    parameters = "".join(
        f'[[parameter]]\nname = "{name}"\nabsolute = true\nlower = {BOUNDS[0]}\nupper = {BOUNDS[1]}\n'
        + (f'fields = ["MAT1 {m} E"]\n' if with_deck else f"nominal = {NOMINAL}\n")
        for m, name in enumerate(TRUE, start=1)
    )
    grid = "" if with_deck else '[model]\ngrid = "frame.inp"\n'
    return f"""[study]
title = "Frame of two storeys"
units = "m-kg-s"
{source}
{grid}[modes]
count = {MODES}
[solver]
command = ["{program}", "frame"]
templates = ["frame.inp"]
result = "frame.frd"
format = "calculix-frd"
environment = {{ OMP_NUM_THREADS = "1" }}
{derivatives}
[parallel]
workers = 1
[sensors]
by_id = true
[test]
file = "frame.uff"
{parameters}[residuals]
frequency_sd = {NOISE}
"""
