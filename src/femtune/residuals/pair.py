"""Residuals that are made pair by pair of a test mode and the model's motion that stands against it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from femtune.residuals.block import ResidualBlock
from femtune.residuals.case import CaseState, PairedMode


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
