"""Outcomes of the steps of a run: each step finds an object of a type of its own, by which later steps ask for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from numpy.typing import NDArray

from femtune.study.record import Alert

if TYPE_CHECKING:
    from femtune.residuals import Evaluation
    from femtune.steps.correlate.versions import ModelRecords
    from femtune.steps.equalise.record import MappedDamping
    from femtune.steps.results import Results
    from femtune.steps.select.record.fisher import FisherResults
    from femtune.steps.update.record.iterations import IterationFrfs
    from femtune.steps.update.record.left_out import ModeLeftOutOfFrfs
    from femtune.steps.update.record.truncation import FrfTruncation
    from femtune.steps.update.run import FoundParameters
    from femtune.steps.validate.facts import Sensitivities
    from femtune.steps.validate.frf_validation import UnusedFrfs
    from femtune.steps.validate.record.frf_deviation import FrfDeviations
    from femtune.steps.vibration.record import VibrationResults
    from femtune.steps.vibration.run import VibrationTests
    from femtune.steps.write.run import WriteBack
    from femtune.study.repeats import Repeats
    from femtune.study.study import Study

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Prepared:
    """What is known before anything is solved: facts of the study, repeated tests (or None), and vibration tests."""

    facts: Results
    repeats: Repeats | None
    vibration_tests: VibrationTests


@dataclass(frozen=True, eq=False)
class Initial:
    """The update problem and the records of the model at the initial values."""

    at: Evaluation
    records: ModelRecords


@dataclass(frozen=True, eq=False)
class Updated:
    """The update, the information of the FRFs at its end, and the compared FRFs at each iteration."""

    parameters: FoundParameters
    fisher: FisherResults | None
    iteration_frfs: tuple[IterationFrfs, ...]

    @property
    def at(self) -> Evaluation:
        """The update problem at the end of the update."""
        return self.parameters.result.after

    def study(self, before: Study) -> Study:
        """The study in which the update ended, which is another one if the update had stages."""
        return self.parameters.study or before


@dataclass(frozen=True, eq=False)
class TruncationErrors:
    """Errors of the FRFs by truncation of the modes, at start and end of the update."""

    records: tuple[FrfTruncation, ...]


@dataclass(frozen=True, eq=False)
class ModesLeftOut:
    """Modes of the model that FRFs are compared without."""

    records: tuple[ModeLeftOutOfFrfs, ...]


@dataclass(frozen=True, eq=False)
class Final:
    """The records of the model at the end of the update, and the sensitivities of the frequencies that it predicts."""

    records: ModelRecords
    sensitivities: Sensitivities


@dataclass(frozen=True, eq=False)
class Damped:
    """Measured damping on the modes of the updated model."""

    records: tuple[MappedDamping, ...]


@dataclass(frozen=True, eq=False)
class Unused:
    """Measured FRFs that the update did not use, and the deviations of all FRFs at the start and the end."""

    frfs: tuple[UnusedFrfs, ...]
    deviations: FrfDeviations | None


@dataclass(frozen=True, eq=False)
class Vibrated:
    """Vibration tests beside the model."""

    records: tuple[VibrationResults, ...]


@dataclass(frozen=True, eq=False)
class Written:
    """The updated deck, and the study on it."""

    deck: WriteBack
    study: Study


@dataclass(frozen=True, eq=False)
class AsWritten:
    """The records of the updated deck, and its weighted mean error."""

    records: ModelRecords
    error: float | None


@dataclass
class Made:
    """What a step makes besides its outcome: arrays of its records by key, and names of files that it has written."""

    arrays: dict[str, NDArray] = field(default_factory=dict)
    files: list[str] = field(default_factory=list)

    def add_files(self, written: Iterable[Path]) -> None:
        """Enter the names of files that were written."""
        self.files.extend(path.name for path in written)


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Outcomes of the steps that have run.

    Parameters
    ----------
    by_type : an outcome of each type; records of a step are outcomes, too
    arrays : arrays of all records, by key
    files : names of the files that were written into the run folder, except those that every run has
    alerts : steps that failed
    """

    by_type: Mapping[type, object] = field(default_factory=dict)
    arrays: Mapping[str, NDArray] = field(default_factory=dict)
    files: tuple[str, ...] = ()
    alerts: tuple[Alert, ...] = ()

    def find(self, kind: type[T]) -> T | None:
        """The outcome of that type; None if its step has not run, failed, or had nothing to do."""
        outcome = self.by_type.get(kind)
        assert outcome is None or isinstance(outcome, kind)
        return outcome

    def of(self, kind: type[T]) -> T:
        """The outcome of that type, whose step comes earlier and ends the run if it fails."""
        outcome = self.find(kind)
        if outcome is None:
            raise LookupError(f"no step has found {kind.__name__} yet")
        return outcome

    def with_outcome(self, outcome: object | None, made: Made) -> Outcomes:
        """With the outcome of a further step, which replaces an earlier one of its type; None for no outcome."""
        more = {} if outcome is None else {type(outcome): outcome}
        return replace(
            self,
            by_type={**self.by_type, **more},
            arrays={**self.arrays, **made.arrays},
            files=(*self.files, *made.files),
        )
