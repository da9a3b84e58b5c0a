"""The data of a study from which a kind of residual is built for a [[residual]] table."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Reals
from femtune.correlation import SensorPlacement
from femtune.dofs import DofSet
from femtune.errors import FemtuneError, Notice, Where
from femtune.identification import EqualisedTest
from femtune.modal import FrfSet, ModeSet
from femtune.model import ModalDamping
from femtune.residuals.weights import Weights


class Asked(Protocol):
    """One [[residual]] table, and the configuration that it is about."""

    @property
    def entry(self) -> Any:
        """The table, checked: its keys are attributes."""
        ...

    @property
    def name(self) -> str:
        """Name of the configuration."""
        ...

    @property
    def modes(self) -> ModeSet:
        """The modes of the configuration's test (error ``study.no-test`` where it has none)."""
        ...

    @property
    def tested(self) -> ModeSet | None:
        """The modes of the configuration's test; None if it has none."""
        ...

    @property
    def frfs(self) -> FrfSet | None:
        """The FRFs of the test; None if it has none."""
        ...

    @property
    def decay(self) -> float:
        """1/τ of the exponential window with which the FRFs were made, rad/s; 0 without one."""
        ...

    def equalised(self, rigid: Callable[[FrfSet], ModeSet] | None = None) -> EqualisedTest | None:
        """These FRFs with one damping ratio, identified once, if the study requests it; errors ``identify.*``.

        `rigid` gives the rigid-body modes of the model at the channels of functions, where the study takes them away.
        """
        ...

    @property
    def damping(self) -> ModalDamping | None:
        """Modal damping of the deck."""
        ...

    @property
    def short(self) -> bool:
        """True for what [residuals] says of all configurations at once."""
        ...

    @property
    def of_largest(self) -> bool:
        """True where the standard deviation of shapes is relative to the largest entry of each."""
        ...

    @property
    def placement(self) -> SensorPlacement | None:
        """Errors in the positions and directions of the sensors of the modes; None if the study states none."""
        ...

    def in_band(self, low_hz: float, high_hz: float) -> Asked:
        """The table with `from_hz` and `to_hz` limited to a band."""
        ...

    def where(self, *keys: str | int) -> Where:
        """Place of the table, or of one of its keys."""
        ...

    def errors_at(self, *keys: str | int) -> AbstractContextManager[None]:
        """Errors that are raised inside without a place get this one."""
        ...

    def rows(self, key: str) -> sp.csr_array:
        """(n, n_g) the DOFs that the labels under a key name; errors ``model.*``, ``response.held-port``."""
        ...

    def seen(self, wanted: DofSet) -> tuple[DofSet, sp.csr_array, tuple[Notice, ...]]:
        """DOFs of the test that have a place in the model and can move, their rows (n, n_g), and remarks on others."""
        ...


def asked_covariance(asked: Asked, n: int, what: str) -> Reals:
    """The covariance of a table, of n values (errors ``residual.weights``, ``residual.covariance``)."""
    with asked.errors_at("covariance"):
        matrix = np.array(asked.entry.covariance, dtype=float)
        Weights(covariance=matrix).check_size(n, what)
    return matrix


def asked_weights(asked: Asked, n: int, what: str, size: float = 1.0) -> Weights:
    """The standard deviation of a table, relative to a size, or its covariance of n values."""
    if asked.entry.covariance is not None:
        return Weights(covariance=asked_covariance(asked, n, what))
    return Weights(asked.entry.sd * size)


def check_asked_mass_scaled(asked: Asked) -> None:
    """Refuse a test whose shapes are not of unit modal mass (error ``residual.not-mass-scaled``)."""
    if asked.modes.normalisation != "mass" and not asked.entry.mass_scaled:
        raise FemtuneError(
            "residual.not-mass-scaled/table",
            where=asked.where(),
            values={"normalisation of the test": asked.modes.normalisation},
            configuration=asked.name,
        )
