"""A test mode beside the model's motion that stands against it, and residuals that are made pair by pair."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.residuals.aligned import AlignedModes
from femtune.residuals.block import ResidualBlock
from femtune.residuals.case import Group, ModalCase

if TYPE_CHECKING:
    from femtune.residuals.state import CaseState

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PairedMode:
    """One test mode and the model's aligned motion.

    Parameters
    ----------
    position : of the test mode in the case's test
    eigenvalue, eigenvalue_gradient : λ in rad²/s² of the model, and ∂λ/∂x (k,)
    shape, shape_gradient : (s,) and (s, k) model shape at the sensors, of unit modal mass
    """

    case: ModalCase
    position: int
    eigenvalue: float
    eigenvalue_gradient: Reals
    shape: Reals
    shape_gradient: Reals

    @property
    def label(self) -> str:
        """Label of the test mode."""
        return self.case.test.labels[self.position]

    @property
    def test_hz(self) -> float:
        """Test frequency."""
        return float(self.case.test.freq_hz[self.position])

    @property
    def test_shape(self) -> Reals:
        """(s,) test shape; NaN entries were not measured."""
        return np.asarray(self.case.test.shapes[:, self.position])


def pairs_of_group(case: ModalCase, group: Group, aligned: AlignedModes) -> Iterator[PairedMode]:
    """The pairs of one group, in the order of its test modes."""
    for a, i in enumerate(group[0]):
        value, slope = float(aligned.eigenvalues[a]), aligned.eigenvalue_gradients[a]
        yield PairedMode(case, i, value, slope, aligned.shapes[:, a], aligned.shape_gradients[:, a])


class OfPairs(ABC):
    """A residual that is made of paired modes."""

    on_modes = True

    @abstractmethod
    def of_pairs(self, pairs: Sequence[PairedMode]) -> Sequence[ResidualBlock]:
        """The blocks of all pairs of one configuration; nothing where no mode is paired."""

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """See `Residual`."""
        return self.of_pairs(list(state.pairs(derivatives)))


class PairResidual(OfPairs):
    """A residual that is made of each pair by itself."""

    @abstractmethod
    def of_pair(self, pair: PairedMode) -> ResidualBlock:
        """The block of one pair."""

    def of_pairs(self, pairs: Sequence[PairedMode]) -> Sequence[ResidualBlock]:
        """One block a pair."""
        return [self.of_pair(pair) for pair in pairs]


@dataclass(frozen=True)
class ByMode(OfPairs):
    """Several residuals of pairs, all those of one mode before those of the next."""

    parts: tuple[PairResidual, ...]

    def of_pairs(self, pairs: Sequence[PairedMode]) -> Sequence[ResidualBlock]:
        """The blocks of each pair in turn."""
        return [part.of_pair(pair) for pair in pairs for part in self.parts]

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """See `Residual`; where nothing is compared nothing is solved."""
        return super().blocks(state, derivatives) if self.parts else []


@dataclass(frozen=True)
class OfModes(OfPairs):
    """A residual limited to the test modes of some labels."""

    residual: OfPairs
    labels: tuple[str, ...]

    def of_pairs(self, pairs: Sequence[PairedMode]) -> Sequence[ResidualBlock]:
        """The blocks of the chosen pairs."""
        return self.residual.of_pairs([pair for pair in pairs if pair.label in self.labels])
