"""Simulated tests of the exhaust system, its parts and the whole: noisy modes and FRFs, and weighed masses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import Dof, DofSet
from femtune.fem import FieldRef
from femtune.files.nastran import build_structure, read_deck
from femtune.files.uff import write_uff_frfs, write_uff_modes
from femtune.modal import FrfSet, ModeSet
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    EigenSolution,
    configure,
    parametric_model,
    solve_modes,
)
from femtune.model.response import frf, make_ports, mass_response
from femtune.parameters import Parameter, ParameterSet
from femtune.testdata import ModalTest, WireFrame
from femtune.testing.exhaust import CLAMP, FRONT, REAR, Exhaust
from femtune.units import unit_system

Reals = NDArray[np.float64]

WHOLE = "whole system"


@dataclass(frozen=True)
class Known:
    """A parameter whose true value is known: `fields` of the deck; value in the deck, and in truth."""

    name: str
    fields: tuple[str, ...]
    nominal: float
    truth: float
    kind: str
    unit: str = ""


KNOWN = (
    Known("m_converter", ("PSHELL 2 NSM",), 15.0, 17.5, "mass", "kg/m^2"),
    Known("m_wool", ("PSHELL 4 NSM",), 4.0, 3.1, "mass", "kg/m^2"),
    Known("E_front", ("MAT1 1 E",), 2.1e11, 1.95e11, "stiffness", "Pa"),
    Known("E_converter", ("MAT1 2 E",), 2.1e11, 2.35e11, "stiffness", "Pa"),
    Known("E_rear", ("MAT1 3 E",), 2.1e11, 2.23e11, "stiffness", "Pa"),
    Known("E_muffler", ("MAT1 4 E",), 2.1e11, 1.85e11, "stiffness", "Pa"),
    Known("k_bend", ("PBUSH 9 K5", "PBUSH 9 K6"), 2.0e4, 1.2e4, "joint", "N*m/rad"),
    Known("k_twist", ("PBUSH 9 K4",), 1.2e4, 1.7e4, "joint", "N*m/rad"),
    Known("eta_front", ("MAT1 1 GE",), 0.01, 0.0045, "damping"),
    Known("eta_converter", ("MAT1 2 GE",), 0.01, 0.02, "damping"),
    Known("eta_rear", ("MAT1 3 GE",), 0.01, 0.006, "damping"),
    Known("eta_muffler", ("MAT1 4 GE",), 0.01, 0.025, "damping"),
    Known("b_bend", ("PBUSH 9 B5", "PBUSH 9 B6"), 1.0, 3.0, "joint damping", "N*m*s/rad"),
    Known("b_twist", ("PBUSH 9 B4",), 1.0, 2.0, "joint damping", "N*m*s/rad"),
)


@dataclass(frozen=True)
class Noise:
    """Standard deviations: of frequencies and weighed masses (relative), of entries of shapes of unit norm, of FRFs.

    FRFs scatter by `frf` of their magnitude and by `floor` of the largest magnitude of each function, in real and
    imaginary part.
    """

    frequency: float = 1e-4
    shape: float = 0.005
    mass: float = 2e-3
    damping: float = 0.1
    frf: float = 0.03
    floor: float = 1e-4


@dataclass(frozen=True)
class Measured:
    """A simulated test with the elements that its state lacks, and what a balance says."""

    name: str
    elements_off: tuple[int, ...]
    test: ModalTest
    weighed: float


BANDS = {FRONT: 540.0, REAR: 560.0, WHOLE: 270.0}
"""Hz, up to which each state is tested."""
_BASIS_MODES = 70
_LOWEST_HZ = 5.0


def simulated_tests(
    exhaust: Exhaust, deck: Path, seed: int = 0, noise: Noise = Noise(), step_hz: float = 0.25
) -> tuple[Measured, ...]:
    """Tests of both parts and of the whole at the true parameters; `deck` is the file of the nominal model."""
    rng = np.random.default_rng(seed)
    whole = exhaust.sensors[FRONT] + exhaust.sensors[REAR]
    drives = exhaust.drives[FRONT]
    clamp = exhaust.elements[CLAMP]
    states = (
        (FRONT, exhaust.elements[REAR] + clamp, exhaust.sensors[FRONT], exhaust.drives[FRONT]),
        (REAR, exhaust.elements[FRONT] + clamp, exhaust.sensors[REAR], exhaust.drives[REAR]),
        (WHOLE, (), whole, drives),
    )
    model = true_model(deck)
    return tuple(_measured(exhaust, model, state, rng, noise, step_hz) for state in states)


def true_model(deck: Path) -> ConfiguredModel:
    """The deck with all parameters at their true values, in the state of the deck."""
    structure = build_structure(read_deck(deck)).structure
    parameters = ParameterSet(tuple(Parameter(k.name, k.truth, 0.5 * k.truth, 2.0 * k.truth) for k in KNOWN))
    fields = [Assignment(k.name, reference(f), relative=False) for k in KNOWN for f in k.fields]
    return configure(parametric_model(structure, parameters, fields), Configuration())


def reference(text: str) -> FieldRef:
    card, number, name = text.split()
    return FieldRef(card, int(number), name)


_State = tuple[str, tuple[int, ...], tuple[int, ...], tuple[int, ...]]


def _measured(
    exhaust: Exhaust, model: ConfiguredModel, state: _State, rng: np.random.Generator, noise: Noise, step_hz: float
) -> Measured:
    name, off, sensors, drives = state
    configured = configure(model.model, Configuration(name, elements_off=frozenset(off)))
    solution = solve_modes(configured.at(np.zeros(len(KNOWN))), _BASIS_MODES)
    nodes = list(dict.fromkeys((*sensors, *drives)))
    dofs = [Dof(n, d) for n in nodes for d in "XYZ"]
    modes = _modes(configured, solution, dofs, BANDS[name], rng, noise)
    seen = [d for d in dofs if d.direction != "X"]
    driven = [Dof(n, d) for n in drives for d in "YZ"]
    frfs = _frfs(configured, solution, seen, driven, BANDS[name], step_hz, rng, noise)
    frame = WireFrame(np.array(nodes), np.array([exhaust.xyz[n] for n in nodes]))
    test = ModalTest(name, unit_system("m-kg-s"), frame, modes=modes, frfs=frfs)
    mass = float(mass_response(configured.at(np.zeros(len(KNOWN)))).properties.mass)
    return Measured(name, off, test, mass * (1.0 + noise.mass * rng.standard_normal()))


def _modes(
    configured: ConfiguredModel,
    solution: EigenSolution,
    dofs: list[Dof],
    band: float,
    rng: np.random.Generator,
    noise: Noise,
) -> ModeSet:
    """Elastic modes in the band: undamped frequencies and shapes, damping ratios by energy, all with noise."""
    some = np.flatnonzero((solution.freq_hz > _LOWEST_HZ) & (solution.freq_hz < band))
    rows = make_ports(configured, dofs[:1], dofs).outputs
    shapes = np.asarray(rows @ solution.shapes[:, some])
    shapes = shapes / np.linalg.norm(shapes, axis=0)
    freq = solution.freq_hz[some] * (1.0 + noise.frequency * rng.standard_normal(len(some)))
    ratio = _ratios(solution, some) * (1.0 + noise.damping * rng.standard_normal(len(some)))
    order = np.argsort(freq)
    shapes = shapes + noise.shape * rng.standard_normal(shapes.shape)
    return ModeSet(freq[order], shapes[:, order], DofSet(dofs), damping_ratio=ratio[order], source="simulated")


def _ratios(solution: EigenSolution, some: NDArray[np.int64]) -> Reals:
    """φᵀ(ωC + H)φ/2ω²: what a fit finds of light damping."""
    phi, omega = solution.shapes[:, some], np.sqrt(solution.eigenvalues[some])
    viscous, hysteretic = (
        np.einsum("ij,ij->j", phi, m @ phi) for m in (solution.point.viscous, solution.point.hysteretic)
    )
    return np.asarray((omega * viscous + hysteretic) / (2.0 * omega**2))


def _frfs(
    configured: ConfiguredModel, solution: EigenSolution, outputs: list[Dof], inputs: list[Dof], band: float,
    step_hz: float, rng: np.random.Generator, noise: Noise,
) -> FrfSet:  # fmt: skip
    """Accelerances by real modes far beyond the band, with residual vectors."""
    lines = np.arange(_LOWEST_HZ, band, step_hz)
    exact = frf(solution, make_ports(configured, inputs, outputs), lines)
    size = np.abs(exact.values)
    sd = np.hypot(noise.frf * size, noise.floor * size.max(axis=2, keepdims=True))
    scatter = rng.standard_normal(size.shape) + 1j * rng.standard_normal(size.shape)
    return replace(exact, values=exact.values + sd * scatter, source="simulated")


def write_tests(measured: tuple[Measured, ...], folder: Path) -> dict[str, str]:
    """A Universal File for each state, modes and FRFs in one; names by state."""
    names = {}
    for one in measured:
        path = folder / f"{one.name.replace(' ', '_')}.uff"
        frfs = path.with_suffix(".frfs.uff")
        write_uff_modes(path, one.test)
        write_uff_frfs(frfs, one.test)
        with path.open("a", encoding="ascii") as out:
            out.write(functions_of(frfs.read_text(encoding="ascii")))
        frfs.unlink()
        names[one.name] = path.name
    return names


def functions_of(text: str) -> str:
    """The data sets 58 of a Universal File."""
    sets = text.split("    -1\n")
    return "".join(f"    -1\n{one}    -1\n" for one in sets if one.startswith("    58"))
