"""What a run gave: modes, or the reason why it has none."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from femtune.files.modes.solved import SolvedModes


class FailureKind(Enum):
    """Why a run is not used; the value is how tables and the journal call it."""

    EXIT_CODE = "exit code"
    TIME_OUT = "time-out"
    ERROR_TEXT = "error text"
    LICENCE = "licence refused"
    NO_OUTPUT = "no output"
    BAD_OUTPUT = "unreadable output"
    NOT_SANE = "implausible modes"


@dataclass(frozen=True)
class Failure:
    """One attempt that failed.

    Parameters
    ----------
    kind : of failure
    sentence : what was found, with the file
    folder : of the attempt
    """

    kind: FailureKind
    sentence: str
    folder: str = ""

    def __str__(self) -> str:
        return f"{self.kind.value}: {self.sentence}"


@dataclass(frozen=True, eq=False)
class RunOutcome:
    """A run with all its attempts.

    Parameters
    ----------
    key : digest of its inputs
    modes : what the solver found; None where every attempt failed
    failures : attempts that failed, before the one that did not
    lasting : whether it may be used by later starts; not if files that the run read were changed meanwhile
    """

    key: str
    modes: SolvedModes | None
    failures: tuple[Failure, ...] = field(default=())
    lasting: bool = True

    @property
    def attempts(self) -> int:
        """How often the solver was started."""
        return len(self.failures) + (self.modes is not None)

    @property
    def state(self) -> str:
        """ "done", or the kind of the last failure."""
        return "done" if self.modes is not None else self.failures[-1].kind.value
