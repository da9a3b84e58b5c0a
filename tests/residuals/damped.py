"""A damped chain with parameters of every kind, and FRFs that were measured on it, for the tests of FRF residuals."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.fem import FieldRef
from femtune.modal import FrfSet
from femtune.modal.kinds import FrfKind
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model
from femtune.model.response import Ports, frf, make_ports
from femtune.parameters import Parameter, ParameterSet
from structures.frames import make_structure, scalars

LINES = np.linspace(0.5, 9.0, 120)
TRUTH = np.array([0.15, -0.2, 0.4, 0.5])
FIELDS = {
    "k": FieldRef("CELAS2", 2, "K"),
    "m": FieldRef("CMASS2", 1003, "M"),
    "c": FieldRef("CDAMP2", 2001, "B"),
    "g": FieldRef("CELAS2", 3, "GE"),
}


@lru_cache
def chain(loss: float = 0.03) -> ConfiguredModel:
    """Four masses along X; factors k of a spring, m of a mass, c of a dashpot, g of a loss factor."""
    springs = scalars("spring", [[-1, 0], [0, 6], [6, 12], [12, 18], [0, 12]], "K", [900.0, 700.0, 800.0, 500.0, 150.0])
    parts = [
        replace(springs, values={**springs.values, "GE": loss}),
        scalars("scalar-mass", [[6 * i, -1] for i in range(4)], "M", [1.0, 2.0, 1.5, 1.0]),
        scalars("dashpot", [[-1, 6], [12, 18]], "B", [1.5, 1.0]),
        # a motion of its own, which nothing couples to the chain
        scalars("spring", [[-1, 7]], "K", [400.0]),
        scalars("scalar-mass", [[7, -1]], "M", [1.0]),
    ]
    xyz = np.column_stack([np.arange(4.0), np.zeros((4, 2))])
    model = parametric_model(
        make_structure(xyz, parts),
        ParameterSet(tuple(Parameter(name, 1.0, 0.1, 5.0) for name in FIELDS)),
        [Assignment(name, ref) for name, ref in FIELDS.items()],
    )
    return configure(model, Configuration())


def ports_of(model: ConfiguredModel, outputs: tuple[str, ...] = ("1X+", "2X-", "4X+")) -> Ports:
    """Driven at 1 and 3."""
    return make_ports(model, ["1X+", "3X+"], outputs)


def measured(
    model: ConfiguredModel, ports: Ports, kind: FrfKind = "accelerance", noise: float = 0.0, seed: int = 0
) -> FrfSet:
    """FRFs at TRUTH, by the inverse of the dynamic stiffness, with noise."""
    return noisy(frf(model.at(TRUTH), ports, LINES, kind, "direct"), noise, seed)


def noisy(exact: FrfSet, noise: float, seed: int) -> FrfSet:
    """The functions with circular noise, a part of the largest magnitude of each."""
    scatter = noise * np.abs(exact.values).max(axis=2, keepdims=True)
    return replace(exact, values=exact.values + scatter * circular(exact.values.shape, seed))


def circular(shape: tuple[int, ...], seed: int) -> NDArray[np.complex128]:
    """Complex numbers of unit variance in real and imaginary part."""
    chance = np.random.default_rng(seed)
    return np.asarray(chance.standard_normal(shape) + 1j * chance.standard_normal(shape))


def with_gap(frfs: FrfSet, output: int, reference: int) -> FrfSet:
    """The functions without one of them."""
    values = frfs.values.copy()
    values[output, reference] = np.nan
    return replace(frfs, values=values)


LABELS = DofSet.parse(["1X+", "2X-", "4X+"])
