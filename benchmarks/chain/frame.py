"""Structures with uncertain moduli, their simulated tests of uneven damping, and their studies with equal damping.

A frame: rectangle of 1.0 × 0.6 m with a cross bar at x = 0.375 m, in its plane: 38 beams, 108 degrees of freedom, five
moduli. A plate of 0.9 × 0.6 m with a step of its thickness: 60 shells, 231 degrees of freedom, six moduli. Neither has
a support. Everything that is drawn follows from the set-up, the kind and the number of a trial.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from femtune.files.nastran import build_structure, read_deck
from femtune.files.uff import write_uff_frfs
from femtune.modal import FrfSet
from femtune.model import Configuration, configure, damping_by_mode, parametric_model, solve_modes
from femtune.model.response import frf, make_ports
from femtune.parameters import ParameterSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

Kind = Literal["right", "compliance", "mass", "missed"]
"""A right model; one that lacks a soft joint, or a mass; a right one whose identification is told to drop a mode."""
KINDS: tuple[Kind, ...] = get_args(Kind)
SetUp = Literal["frame 8 x 2", "frame 25 x 2", "frame 1 x 25", "plate 56 x 1"]
"""Structure, and the numbers of its outputs and inputs."""
SETUPS: tuple[SetUp, ...] = get_args(SetUp)
SPREAD = 0.2
"""True moduli are drawn between 1 − SPREAD and 1 + SPREAD."""
ZETA = (0.002, 0.02)
"""Limits of the damping ratios, drawn evenly in their logarithms."""
NOISE, FLOOR = 0.01, 0.001
"""Standard deviation of the noise: of the magnitude, and of the largest magnitude of each FRF."""
LINES = np.arange(20.0, 400.0, 0.5)
SOFT = 0.5
"""Factor on the modulus of the two beams beside a corner, in the structure that has a soft joint."""
MASS = 0.15
"""Mass in kg at a point, in the structure that has one; the frame has 7.2 kg."""
EQUAL = 0.02

_E, _MODES = 2.1e11, 40
_CORNERS = {"a": (0.0, 0.0), "b": (1.0, 0.0), "c": (1.0, 0.6), "d": (0.0, 0.6), "e": (0.375, 0.0), "f": (0.375, 0.6)}
_BARS = {"bottom": (("a", "e", 4), ("e", "b", 6)), "top": (("d", "f", 4), ("f", "c", 6)), "left": (("a", "d", 6),),
         "right": (("b", "c", 6),), "cross": (("e", "f", 6),)}  # fmt: skip
_OUTPUTS = ((0.0, 0.0), (0.25, 0.6), (1.0, 0.0), (0.375, 0.3), (0.6875, 0.0), (0.0, 0.3), (1.0, 0.6), (1.0, 0.3))
_AXES = ("Y", "Y", "Y", "X", "Y", "X", "X", "X")
_INPUTS = (((0.0, 0.0), "Y"), ((1.0, 0.3), "X"))
_FRAME_GROUPS = tuple(_BARS)
_PLATE_GROUPS = tuple(f"field_{i}" for i in range(1, 7))
_PLATE = (0.9, 0.6, 10, 6)
"""Length, width, and number of shells along each."""
_THICK = (0.004, 0.005)
"""Thickness of the plate: of the fields at one long edge, and of those at the other."""


@dataclass(frozen=True)
class Trial:
    """One test and its study.

    Parameters
    ----------
    kind, number : what is planted, and which of its trials
    noisy : whether the FRFs have noise
    setup : structure and channels; all kinds are planted in the first one only
    """

    kind: Kind
    number: int
    noisy: bool = True
    setup: SetUp = "frame 8 x 2"

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return _PLATE_GROUPS if self.setup.startswith("plate") else _FRAME_GROUPS

    def deck(self, moduli: NDArray[np.float64] | None = None) -> str:
        """The deck as it stands, or that of the true structure with these moduli."""
        if self.setup.startswith("plate"):
            return _plate(moduli)
        return _deck(moduli, "right" if moduli is None else self.kind)

    def channels(self) -> tuple[list[str], list[str]]:
        """Inputs and outputs."""
        if self.setup.startswith("plate"):
            columns, rows = _PLATE[2] + 1, _PLATE[3] + 1
            outputs = [f"{1 + i + columns * j}Z+" for j in range(rows) for i in range(0, columns, 1)
                       if (i + j) % 4 != 3]  # fmt: skip
            return [f"{1 + 2 + columns}Z+"], outputs[:56]
        inputs = [f"{_node(p)}{axis}+" for p, axis in _INPUTS]
        if self.setup == "frame 8 x 2":
            return inputs, [f"{_node(p)}{axis}+" for p, axis in zip(_OUTPUTS, _AXES)]
        many = [f"{n}{axis}+" for n in sorted(_NODES)[::2] for axis in "XY"][:25]
        return (inputs, many) if self.setup == "frame 25 x 2" else (many, [f"{_node((0.0, 0.0))}Y+"])

    @property
    def chance(self) -> np.random.Generator:
        """The same tests for all kinds, so that they can be compared."""
        return np.random.default_rng([self.number, 7])

    @property
    def truth(self) -> NDArray[np.float64]:
        """True moduli of the groups, relative to those of the deck."""
        return self.chance.uniform(1.0 - SPREAD, 1.0 + SPREAD, len(self.groups))

    def write(self, folder: Path, more: str = "") -> Path:
        """Deck, test and study in a folder; the path of the study."""
        (folder / "deck.bdf").write_text(self.deck(), encoding="utf-8")
        hertz = self.measure(folder, self.truth)
        inside = hertz[(hertz > LINES[0]) & (hertz < LINES[-1])]
        dropped = f"drop_hz = [{inside[self.number % len(inside)]:.4f}]\n" if self.kind == "missed" else ""
        study = folder / "study.toml"
        equalise = f"[equalise]\ndamping = {EQUAL}\n{dropped}{more}"
        study.write_text(_HEAD + _TEST + _parameters(self.groups) + equalise, encoding="utf-8")
        return study

    def measure(self, folder: Path, moduli: NDArray[np.float64], name: str = "test") -> NDArray[np.float64]:
        """Write the test of the structure with true moduli and its deck `true.bdf`; its natural frequencies, Hz."""
        true = folder / "true.bdf"
        true.write_text(self.deck(moduli), encoding="utf-8")
        functions, hertz = _functions(true, self)
        points = np.unique(np.array([d.node for d in (*functions.responses, *functions.references)]))
        nodes = _plate_nodes() if self.setup.startswith("plate") else _NODES
        frame = WireFrame(points, np.array([(*nodes[n], 0.0) for n in points]))
        write_uff_frfs(folder / f"{name}.uff", ModalTest(name, SI, frame, frfs=functions))
        return hertz


def write_specimens(folder: Path, factors: dict[str, float], individual: str, more: str = "") -> tuple[Path, Moduli]:
    """Frames of one drawing, fitted together: deck, tests and study, and the true moduli by name.

    The frames have the moduli of the first trial of right models, and damping and noise of the first, the second …

    Parameters
    ----------
    factors : of the individual modulus of each specimen, by its name
    """
    trials = [Trial("right", number) for number in range(len(factors))]
    first = trials[0]
    (folder / "deck.bdf").write_text(first.deck(), encoding="utf-8")
    common = dict(zip(first.groups, first.truth.tolist()))
    own = common.pop(individual)
    truth, configurations = common, ""
    for trial, (name, factor) in zip(trials, factors.items()):
        moduli = np.array([own * factor if group == individual else common[group] for group in first.groups])
        trial.measure(folder, moduli, name)
        configurations += f'[[configuration]]\nname = "{name}"\nspecimen = "{name}"\ntest = "{name}.uff"\n'
        truth = {**truth, f"{individual}_{name}": own * factor}
    parameters = _parameters(first.groups).replace(f'"{individual}"\n', f'"{individual}"\nindividual = true\n')
    study = folder / "study.toml"
    equalise = f"[equalise]\ndamping = {EQUAL}\n{more}"
    study.write_text(_HEAD + _FRFS + configurations + parameters + equalise, encoding="utf-8")
    return study, truth


Moduli = dict[str, float]

_HEAD = """[study]
title = "Simulated test"
deck = "deck.bdf"
units = "m-kg-s"
[modes]
count = 20
"""
_FRFS = '[[residual]]\nkind = "frf"\n'
_TEST = f'[test]\nfile = "test.uff"\n{_FRFS}'


def _parameters(groups: tuple[str, ...]) -> str:
    return "".join(
        f'[[parameter]]\nname = "{name}"\nfields = ["MAT1 {i} E"]\nlower = 0.5\nupper = 1.5\n'
        for i, name in enumerate(groups, start=1)
    )


def _beams() -> tuple[dict[int, tuple[float, float]], list[tuple[int, int, int]]]:
    """Points by number, and beams as group, first and second point."""
    numbers: dict[tuple[float, float], int] = {}
    beams = []
    for group, bars in enumerate(_BARS.values(), start=1):
        for a, b, count in bars:
            along = np.linspace(_CORNERS[a], _CORNERS[b], count + 1).round(9)
            at = [numbers.setdefault((float(x), float(y)), len(numbers) + 1) for x, y in along]
            beams += [(group, i, j) for i, j in pairwise(at)]
    return {n: p for p, n in numbers.items()}, beams


_NODES, _ELEMENTS = _beams()


def _node(point: tuple[float, float]) -> int:
    """The grid point nearest to a place."""
    return min(_NODES, key=lambda n: np.hypot(_NODES[n][0] - point[0], _NODES[n][1] - point[1]))


def _deck(moduli: NDArray[np.float64] | None = None, kind: Kind = "right") -> str:
    """The deck as it stands, or that of the structure of a kind with true moduli."""
    moduli = np.ones(len(_FRAME_GROUPS)) if moduli is None else moduli
    corner = _node(_CORNERS["c"])
    lines = ["SOL 103", "CEND", "METHOD = 1", "BEGIN BULK", f"EIGRL,1,,,{_MODES}"]
    lines += [f"GRID,{n},,{x},{y},0.0,,345" for n, (x, y) in _NODES.items()]
    for number, (group, a, b) in enumerate(_ELEMENTS, start=1):
        soft = kind == "compliance" and corner in (a, b)
        lines.append(f"CBAR,{number},{group + 10 * soft},{a},{b},0.0,0.0,1.0")
    for group, factor in enumerate(moduli, start=1):
        lines.append(f"MAT1,{group},{_E * factor:.9e},,0.3,7850.0")
        lines.append(f"PBAR,{group},{group},2.4-4,8.0-9,2.88-9,8.0-9")
        if kind == "compliance":
            lines.append(f"MAT1,{group + 10},{_E * factor * SOFT:.9e},,0.3,7850.0")
            lines.append(f"PBAR,{group + 10},{group + 10},2.4-4,8.0-9,2.88-9,8.0-9")
    if kind == "mass":
        lines.append(f"CONM2,900,{_node((0.6875, 0.6))},,{MASS}")
    return "\n".join([*lines, "PARAM,COUPMASS,1", "ENDDATA", ""])


def _plate_nodes() -> dict[int, tuple[float, float]]:
    length, width, along, across = _PLATE
    places = [(length * i / along, width * j / across) for j in range(across + 1) for i in range(along + 1)]
    return dict(enumerate(places, start=1))


def _plate(moduli: NDArray[np.float64] | None) -> str:
    """A free plate in bending; two rows of three fields."""
    moduli = np.ones(len(_PLATE_GROUPS)) if moduli is None else moduli
    _, _, along, across = _PLATE
    lines = ["SOL 103", "CEND", "METHOD = 1", "BEGIN BULK", f"EIGRL,1,,,{_MODES}"]
    lines += [f"GRID,{n},,{x:.6f},{y:.6f},0.0,,126" for n, (x, y) in _plate_nodes().items()]
    for j in range(across):
        for i in range(along):
            field = 1 + min(2, 3 * i // along) + 3 * (2 * j // across)
            a = 1 + i + (along + 1) * j
            lines.append(f"CQUAD4,{1 + i + along * j},{field},{a},{a + 1},{a + along + 2},{a + along + 1}")
    for field, factor in enumerate(moduli, start=1):
        lines.append(f"MAT1,{field},{_E * factor:.9e},,0.3,7850.0")
        lines.append(f"PSHELL,{field},{field},{_THICK[field > 3]},{field}")
    return "\n".join([*lines, "PARAM,COUPMASS,1", "ENDDATA", ""])


def _functions(true: Path, trial: Trial) -> tuple[FrfSet, NDArray[np.float64]]:
    """Accelerances with noise, and the true frequencies."""
    structure = build_structure(read_deck(true)).structure
    model = configure(parametric_model(structure, ParameterSet(()), ()), Configuration())
    solution = solve_modes(model.at(np.zeros(0)), _MODES)
    hertz = solution.freq_hz[:_MODES]
    chance = trial.chance
    chance.random(len(trial.groups))
    zeta = np.exp(chance.uniform(*np.log(ZETA), _MODES))
    zeta[hertz < 1.0] = 0.0
    inputs, outputs = trial.channels()
    ports = make_ports(model, inputs, outputs)
    exact = frf(solution, ports, LINES, "accelerance", damping=damping_by_mode(tuple(zeta)))
    if not trial.noisy:
        return exact, hertz
    size = np.abs(exact.values)
    sd = np.hypot(NOISE * size, FLOOR * size.max(axis=2, keepdims=True))
    noise = chance.standard_normal((2, *size.shape)) / np.sqrt(2.0)
    return replace(exact, values=exact.values + sd * (noise[0] + 1j * noise[1])), hertz
