"""Residuals formed for each pair of a test mode and a model motion."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from femtune.residuals.case import CaseState, PairedMode, Residual
from femtune.residuals.weights import ResidualBlock


class OfPairs(Residual):
    """A residual that is made of paired modes."""

    of_modes = True
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

    @property
    def of_ratio(self) -> bool:
        """See `Residual`."""
        return all(r.of_ratio for r in self.parts)

    def of_kinds(self, keys: Collection[str]) -> Residual | None:
        """The parts of some kinds."""
        parts = tuple(part for part in self.parts if part.key in keys)
        return ByMode(parts) if parts else None

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

    def of_pairs(self, pairs: Sequence[PairedMode]) -> Sequence[ResidualBlock]:
        """The blocks of the chosen pairs."""
        return self.residual.of_pairs([pair for pair in pairs if pair.label in self.labels])
