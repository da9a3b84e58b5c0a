"""Residuals formed for each pair of a test mode and a model motion."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.modal import ModeSet
from femtune.residuals.case import CaseState, PairedMode, Residual
from femtune.residuals.weights import ResidualBlock


def unknown_modes(test: ModeSet, *deviations: Reals | None) -> tuple[int, ...]:
    """Positions of the modes for which not all standard deviations (m,) are known and above zero."""
    known = [np.zeros(len(test), bool) if sd is None else np.asarray(sd) > 0.0 for sd in deviations]
    return tuple(int(i) for i in np.flatnonzero(~np.all(known, axis=0)))


class OfPairs(Residual):
    """A residual that is made of paired modes."""

    of_modes = True
    on_modes = True

    @abstractmethod
    def of_pairs(self, pairs: Sequence[PairedMode]) -> Sequence[ResidualBlock]:
        """The blocks of all pairs of one configuration; nothing where no mode is paired."""

    def without_sd(self, test: ModeSet) -> tuple[int, ...]:
        """Positions of the test modes whose weights are those of the test, which does not give all of them."""
        return ()

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

    @property
    def of_ratio(self) -> bool:
        """See `Residual`."""
        return all(r.of_ratio for r in self.parts)

    def of_kinds(self, keys: Collection[str]) -> Residual | None:
        """The parts of some kinds."""
        parts = tuple(part for part in self.parts if part.key in keys)
        return ByMode(parts) if parts else None

    def without_sd(self, test: ModeSet) -> tuple[int, ...]:
        """Modes without a standard deviation in any of the parts."""
        return tuple(sorted({i for part in self.parts for i in part.without_sd(test)}))

    def of_pairs(self, pairs: Sequence[PairedMode]) -> Sequence[ResidualBlock]:
        """The blocks of each pair in turn."""
        return [part.of_pair(pair) for pair in pairs for part in self.parts]


@dataclass(frozen=True)
class OfModes(OfPairs):
    """A residual limited to the test modes of some labels."""

    residual: OfPairs
    labels: tuple[str, ...]

    @property
    def of_ratio(self) -> bool:
        """See `Residual`."""
        return self.residual.of_ratio

    def of_kinds(self, keys: Collection[str]) -> Residual | None:
        """Itself where its residual is of one of these kinds."""
        return self if self.residual.of_kinds(keys) is not None else None

    def without_sd(self, test: ModeSet) -> tuple[int, ...]:
        """Modes without a standard deviation among the chosen ones."""
        return tuple(i for i in self.residual.without_sd(test) if test.labels[i] in self.labels)

    def of_pairs(self, pairs: Sequence[PairedMode]) -> Sequence[ResidualBlock]:
        """The blocks of the chosen pairs."""
        return self.residual.of_pairs([pair for pair in pairs if pair.label in self.labels])
