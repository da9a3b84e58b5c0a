"""Updates of right and of wrong models with tests of known noise: for the level and power of tests of a fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from femtune.fem import FieldRef
from femtune.modal import ModeSet
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import ComparedCase, FrequencyResidual, ShapeResidual, UpdateProblem
from structures.frames import bars, make_structure, masses
from structures.springs import factor_model, simulated_case, spring_structure

FREQUENCY_SD, SHAPE_SD = 0.003, 0.02
"""Noise of the frequencies, relative, and of the entries of the shapes, relative to the largest of each."""


@dataclass(frozen=True)
class JudgedStructure:
    """A structure with tests of right and of wrong models.

    Parameters
    ----------
    truth : values of the parameters by name
    faults : changes that a test may have and no parameter can follow, by name
    problem : from a seed, the name of a fault or "", and factors on the stated standard deviations of frequencies and
        shapes: the update problem with the noisy test of that seed
    """

    name: str
    truth: dict[str, float]
    faults: tuple[str, ...]
    problem: Callable[[int, str, float, float], UpdateProblem]


def chain() -> JudgedStructure:
    """Twelve masses in a line between walls; five factors on springs by seven modes at all masses."""
    n = 12
    springs = [(i - 1, i if i < n else -1, 1e4) for i in range(n + 1)]
    groups = {f"k{g}": list(range(1 + 2 * g, 3 + 2 * g)) for g in range(5)}
    truth = {"k0": 1.15, "k1": 0.85, "k2": 1.05, "k3": 0.8, "k4": 1.1}
    lumps = [1.0 + 0.1 * (i % 3) for i in range(n)]

    def model(fault: str) -> ConfiguredModel:
        stiff = [(a, b, k * (0.7 if fault == "spring" and i == n - 1 else 1.0)) for i, (a, b, k) in enumerate(springs)]
        stiff += [(6, -1, 2e3)] if fault == "ground" else []
        own = [m * (1.25 if fault == "mass" and i == 4 else 1.0) for i, m in enumerate(lumps)]
        return factor_model(spring_structure(stiff, own), groups, (0.3, 2.0))

    return _judged("chain of springs", truth, ("spring", "ground", "mass"), model, range(n), 7)


def cantilever() -> JudgedStructure:
    """A cantilever of 20 bars in four parts with a mass at its tip; bending stiffness of the parts by six modes."""
    n = 21
    truth = {"EI0": 1.1, "EI1": 0.9, "EI2": 1.05, "EI3": 0.95}
    parameters = ParameterSet(tuple(Parameter(name, 1.0, 0.3, 3.0) for name in truth))
    assignments = [Assignment(f"EI{(i - 1) // 5}", FieldRef("CBAR", i, "E")) for i in range(1, n)]
    held = Configuration(supports_added=((1, "123456"), *((i, "1345") for i in range(2, n + 1))))

    def model(fault: str) -> ConfiguredModel:
        xyz = np.column_stack([np.linspace(0.0, 1.0, n), np.zeros((n, 2))])
        weak = np.where((fault == "crack") & (np.arange(1, n) == 3), 0.5, 1.0)
        section = {"E": 2.1e11 * weak, "G": 8e10, "A": 2e-4, "I1": 1.7e-9, "I2": 6.7e-9, "J": 4e-9, "rho": 7850.0}
        pairs = np.column_stack([np.arange(n - 1), np.arange(1, n)])
        parts = [bars(pairs, section), masses([n - 1], {"M": 0.6 if fault == "tip" else 0.3})]
        kinds = dict.fromkeys(range(1, n), "CBAR") | {1001: "CONM2"}
        structure = make_structure(xyz, parts, element_kinds=kinds)
        return configure(parametric_model(structure, parameters, assignments), held)

    free = model("")
    deflections = [i for i in range(free.n_free) if free.free_dof(i).direction == "Y"]
    return _judged("cantilever", truth, ("crack", "tip"), model, deflections, 6)


def _judged(
    name: str, truth: dict[str, float], faults: tuple[str, ...], model: Callable[[str], ConfiguredModel],
    sensors: Sequence[int], modes: int,
) -> JudgedStructure:  # fmt: skip
    at = [v - 1.0 for v in truth.values()]
    right = model("")
    exact = {f: simulated_case(model(f), at, sensors, modes) for f in ("", *faults)}

    def problem(seed: int, fault: str = "", of_frequencies: float = 1.0, of_shapes: float = 1.0) -> UpdateProblem:
        case = replace(_noisy(exact[fault], seed), configured=right, count=modes + 4)
        stated = (
            FrequencyResidual(FREQUENCY_SD * of_frequencies),
            ShapeResidual(SHAPE_SD * of_shapes, of_largest=True),
        )
        return UpdateProblem((case,), right.model.parameters, stated)

    return JudgedStructure(name, truth, faults, problem)


def _noisy(case: ComparedCase, seed: int) -> ComparedCase:
    rng, test = np.random.default_rng(seed), case.test
    freq = test.freq_hz * (1.0 + FREQUENCY_SD * rng.standard_normal(len(test)))
    largest = np.abs(test.shapes).max(axis=0)
    # the sign of a shape is that of the eigen-solver; the noise shall not depend on it
    shapes = test.shapes * np.sign(test.shapes[np.argmax(np.abs(test.shapes), axis=0), np.arange(len(test))])
    noisy = shapes + SHAPE_SD * largest * rng.standard_normal(shapes.shape)
    return replace(case, test=ModeSet(freq, noisy, test.dofs, source=f"simulated, seed {seed}"))
