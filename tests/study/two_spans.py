"""Two spans and the spring between them: deck, tests of one span and of the whole, and a study of stages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from femtune.dofs import Dof, DofSet
from femtune.files.nastran import build_structure, read_deck
from femtune.files.uff import write_uff_frfs, write_uff_modes
from femtune.modal import ModeSet
from femtune.model import Assignment, Configuration, configure, parametric_model, solve_modes
from femtune.model.response import frf, make_ports
from femtune.parameters import Parameter, ParameterSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI
from structures.exhaust import functions_of, reference

_NODES = range(1, 9)
TRUTH = {"E": ("MAT1 1 E", 2.1e11, 1.9e11), "mass": ("CONM2 90 M", 1.0, 1.2), "eta": ("MAT1 1 GE", 0.02, 0.01),
         "k": ("PBUSH 9 K3", 3.0e5, 2.0e5), "b": ("PBUSH 9 B3", 40.0, 60.0)}  # fmt: skip


def _deck() -> str:
    """Two cantilevers that bend in the plane, tip to tip, and a bush between the tips."""
    lines = ["SOL 103", "CEND", "SPC = 1", "BEGIN BULK", "MAT1,1,2.1+11,,.3,7850.,,,.02",
             "PBAR,1,1,1.-3,2.-7,2.-7,4.-7", "PBUSH,9,K,1.+8,1.+8,3.+5,1.+8,1.+8,1.+8", ",,B,0.,0.,40.",
             "CBUSH,9,9,4,5,,,,0", "CONM2,90,3,,1.0"]  # fmt: skip
    for i in _NODES:
        x = 0.4 * (i - 1) if i <= 4 else 1.2 + 0.4 * (i - 5)
        lines.append(f"GRID,{i},,{x:.2f},0.,0.")
        held = "123456" if i in (1, 8) else "1246"
        lines.append(f"SPC1,1,{held},{i}")
        if i not in (4, 8):
            lines.append(f"CBAR,{i},1,{i},{i + 1},0.,0.,1.")
    return "\n".join([*lines, "ENDDATA", ""])


def _test(deck: Path, name: str, off: Sequence[int], nodes: Sequence[int], count: int) -> None:
    """The true structure's modes and accelerances of a state, without noise."""
    structure = build_structure(read_deck(deck)).structure
    parameters = ParameterSet(tuple(Parameter(n, t, 0.5 * t, 2.0 * t) for n, (_, _, t) in TRUTH.items()))
    model = parametric_model(
        structure, parameters, [Assignment(n, reference(f), False) for n, (f, _, _) in TRUTH.items()]
    )
    configured = configure(model, Configuration(name, elements_off=frozenset(off)))
    solution = solve_modes(configured.at(np.zeros(len(TRUTH))), count)
    dofs = [Dof(n, "Z") for n in nodes]
    ports = make_ports(configured, dofs[-1:], dofs)
    phi, omega = solution.shapes[:, :count], 2.0 * np.pi * solution.freq_hz[:count]
    point = solution.point
    loss = np.einsum("ij,ij->j", phi, point.hysteretic @ phi) + omega * np.einsum("ij,ij->j", phi, point.viscous @ phi)
    modes = ModeSet(
        solution.freq_hz[:count], np.asarray(ports.outputs @ phi), DofSet(dofs), damping_ratio=0.5 * loss / omega**2
    )
    lines = np.linspace(1.0, 1.2 * solution.freq_hz[count - 1], 1500)
    frame = WireFrame(np.array(nodes), np.array([structure.nodes.xyz[n - 1] for n in nodes]))
    test = ModalTest(name, SI, frame, modes=modes, frfs=frf(solution, ports, lines))
    path = deck.with_name(f"{name}.uff")
    write_uff_modes(path, test)
    write_uff_frfs(deck.with_name("frfs.uff"), test)
    path.write_text(path.read_text() + functions_of(deck.with_name("frfs.uff").read_text()))


_STUDY = """
[study]
title = "Two spans"
deck = "spans.bdf"
units = "m-kg-s"
journal = false

[modes]
count = 4

[[configuration]]
name = "left"
test = "left.uff"
elements_off = [5, 6, 7, 9]

[[configuration]]
name = "whole"
test = "whole.uff"

[residuals]
frequency_sd = 1e-4
shape_sd = 1e-3

[sensors]
by_id = true

[[residual]]
kind = "mass"
configuration = "left"
mass = {mass}
sd = 1e-3
"""
_PARAMETER = """
[[parameter]]
name = "{name}"
fields = ["{field}"]
absolute = true
lower = {lower!r}
upper = {upper!r}
"""
_STAGES = """
[[stage]]
name = "left, mass"
configurations = ["left"]
parameters = ["mass"]
residuals = ["mass"]

[[stage]]
name = "left, stiffness"
configurations = ["left"]
parameters = ["E"]
residuals = ["frequency", "shape"]

[[stage]]
name = "left, damping"
configurations = ["left"]
parameters = ["eta"]
residuals = ["resonances"]
seeds = [{ eta = 0.004 }, { eta = 0.06 }]

[[stage]]
name = "joint, stiffness"
configurations = ["whole"]
parameters = ["k"]
residuals = ["frequency", "shape"]

[[stage]]
name = "joint, damping"
configurations = ["whole"]
parameters = ["b"]
residuals = ["resonances"]
"""


def _parameters() -> str:
    entries = (
        _PARAMETER.format(name=n, field=f, lower=0.1 * nominal, upper=10.0 * nominal)
        for n, (f, nominal, _) in TRUTH.items()
    )
    return "".join(entries)


def write_spans(folder: Path) -> Path:
    """Deck, tests and study in a folder."""
    (folder / "spans.bdf").write_text(_deck())
    _test(folder / "spans.bdf", "left", (5, 6, 7, 9), (2, 3, 4), 3)
    _test(folder / "spans.bdf", "whole", (), (2, 3, 4, 5, 6, 7), 4)
    # three bars of 0.4 m and the mass at its true value
    text = _STUDY.format(mass=7850.0 * 1e-3 * 1.2 + 1.2) + _parameters() + _STAGES
    (folder / "study.toml").write_text(text)
    return folder
