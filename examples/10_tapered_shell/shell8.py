"""A CalculiX input of eight-node shells with nodal thickness: read, refined, and written for both programs."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

XI = np.array([-1.0, 1.0, 1.0, -1.0, 0.0, 1.0, 0.0, -1.0])
ETA = np.array([-1.0, -1.0, 1.0, 1.0, -1.0, 0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Shell8:
    """Eight-node shells, corners first: nodes (n, 3), thickness (n,), elements (e, 8) of node rows, clamped rows."""

    xyz: Reals
    thickness: Reals
    elements: NDArray[np.int64]
    clamped: tuple[int, ...]
    young: float
    poisson: float
    density: float


def read_shell8(path: Path) -> Shell8:
    """What the deck shellf.inp has; no reader of CalculiX decks in general."""
    blocks = [b.splitlines() for b in re.split(r"^\*(?=[A-Z])", path.read_text(), flags=re.M)]
    head = [[re.sub(r"\s", "", h) for h in block[0].upper().split(",")] for block in blocks]
    rows = [[[w for w in re.split(r"[,\s]+", line) if w] for line in block[1:] if line[:1] != "*"] for block in blocks]
    named = {h[0]: [r for r in found if r] for h, found in zip(head, rows)}
    number = {int(r[0]): i for i, r in enumerate(named["NODE"])}
    sets = {h[1].removeprefix("NSET="): [int(v) for r in f for v in r] for h, f in zip(head, rows) if h[0] == "NSET"}
    thickness = np.zeros(len(number))
    for which, value in (r[:2] for r in named["NODALTHICKNESS"]):
        for node in sets[which.upper()] if which.upper() in sets else [int(which)]:
            thickness[number[node]] = float(value)
    held = sets[named["BOUNDARY"][0][0].upper()]
    return Shell8(
        np.array([[float(v) for v in r[1:4]] for r in named["NODE"]]),
        thickness,
        np.array([[number[int(v)] for v in r[1:9]] for r in named["ELEMENT"]]),
        tuple(number[n] for n in held),
        *(float(v) for v in named["ELASTIC"][0][:2]),
        float(named["DENSITY"][0][0]),
    )


def functions(xi: float, eta: float) -> Reals:
    """(8,) shape functions of the eight-node quadrilateral."""
    corner = 0.25 * (1 + XI * xi) * (1 + ETA * eta) * (XI * xi + ETA * eta - 1)
    along = 0.5 * (1 - xi**2) * (1 + ETA * eta)
    across = 0.5 * (1 + XI * xi) * (1 - eta**2)
    return np.concatenate([corner[:4], np.where(XI == 0.0, along, across)[4:]])


def refined(shell: Shell8, n: int) -> Shell8:
    """Every element split into n × n; places and thickness as the elements' functions have them."""
    known: dict[tuple[float, ...], int] = {}
    values: list[Reals] = []
    elements = []
    table = np.column_stack([shell.xyz, shell.thickness])
    span = np.ptp(shell.xyz, axis=0).max()

    def row(element: NDArray[np.int64], xi: float, eta: float) -> int:
        value = functions(xi, eta) @ table[element]
        key = tuple((np.round(value[:3] / span, 6) + 0.0).tolist())
        if key not in known:
            known[key] = len(values)
            values.append(value)
        return known[key]

    for element in shell.elements:
        for i in range(n):
            for j in range(n):
                places = [(-1 + (2 * i + 1 + a) / n, -1 + (2 * j + 1 + b) / n) for a, b in zip(XI, ETA)]
                elements.append([row(element, *place) for place in places])
    found = np.array(values)
    # the clamped nodes lie on a line x = constant
    edge = shell.xyz[list(shell.clamped), 0].mean()
    clamped = tuple(np.flatnonzero(np.abs(found[:, 0] - edge) < 1e-6 * span).tolist())
    return Shell8(
        found[:, :3], found[:, 3], np.array(elements), clamped, shell.young, shell.poisson, shell.density
    )  # fmt: skip


def calculix_text(shell: Shell8, modes: int, element: str) -> str:
    """A frequency step with eight-node shells, `element` S8 or S8R."""
    lines = ["*NODE, NSET=ALL", *(f"{i + 1}, {x:.9g}, {y:.9g}, {z:.9g}" for i, (x, y, z) in enumerate(shell.xyz))]
    lines.append(f"*ELEMENT, TYPE={element}, ELSET=SHELL")
    lines += [f"{i + 1}, " + ", ".join(str(v + 1) for v in nodes) for i, nodes in enumerate(shell.elements)]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{shell.young:g}, {shell.poisson:g}", "*DENSITY", f"{shell.density:g}"]
    lines += ["*SHELL SECTION, ELSET=SHELL, MATERIAL=M, NODAL THICKNESS", "1.", "*NODAL THICKNESS"]
    lines += [f"{i + 1}, {t:.9g}" for i, t in enumerate(shell.thickness)]
    lines += ["*NSET, NSET=CLAMPED", *(f"{i + 1}," for i in shell.clamped), "*BOUNDARY", "CLAMPED, 1, 6"]
    return "\n".join([*lines, "*STEP", "*FREQUENCY", str(modes), "*END STEP", ""])


def nastran_text(shell: Shell8, modes: int, card: str = "CQUAD4") -> str:
    """A deck of CQUAD4 on the corners or of CQUAD8 on all nodes, their thickness T1 to T4; coupled mass."""
    lines = ["SOL 103", "CEND", "METHOD = 1", "SPC = 1", "BEGIN BULK", f"EIGRL,1,,,{modes}", "PARAM,COUPMASS,1"]
    lines += [f"MAT1,1,{shell.young:.1f},,{shell.poisson:.4f},{shell.density:.2E}", "PSHELL,1,1,1.,1,,1"]
    elements = shell.elements if card == "CQUAD8" else shell.elements[:, :4]
    used = np.unique(elements)
    for i in used:
        x, y, z = shell.xyz[i]
        lines += [f"GRID*   {i + 1:<16d}{'':16s}{x:<16.9E}{y:<16.9E}", f"*       {z:<16.9E}"]
    for k, nodes in enumerate(elements):
        first, rest = ([str(i + 1) for i in part] for part in (nodes[:6], nodes[6:]))
        lines.append(f"{card},{k + 1},1," + ",".join(first))
        lines.append(f",{','.join(rest or ['', ''])}," + ",".join(f"{t:.6f}" for t in shell.thickness[nodes[:4]]))
    lines += [f"SPC1,1,123456,{i + 1}" for i in shell.clamped if i in used]
    return "\n".join([*lines, "ENDDATA", ""])


def listed_frequencies(text: str) -> Reals:
    """Frequencies in Hz of the first table of eigenvalues in CalculiX's .dat file."""
    head = text.split("P A R T I C I P A T I O N", 1)[0]
    return np.array([float(f) for f in re.findall(r"^\s+\d+\s+\S+\s+\S+\s+(\S+)\s+\S+\s*$", head, re.M)])
