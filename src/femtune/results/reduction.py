"""The reduced models that an update searched on, as records."""

from __future__ import annotations

from femtune.results.base import Record


class ReducedModelResults(Record):
    """The reduced model of one configuration."""

    configuration: str
    """Name of the configuration."""
    order: int
    """Its order at the end."""
    full_solutions: int
    """How many times the full model was solved for its modes to train the model, and where each search ended. The modes
    of the comparison before the update and of the written deck, and derivatives at the end, come on top."""
    estimate_percent: float
    """Largest estimated error of a frequency in the box of the parameters when the search began, in %."""
    certified_error_percent: float
    """Largest true error of a frequency where the search ended, in %, of the model that the search used."""
    training: str
    """How its training ended, in a sentence."""


class ReductionResults(Record):
    """An update that searched on reduced models."""

    tolerance_percent: float
    """Largest error of a frequency that the study allows at the end, in %."""
    certified: bool
    """True where the full models agree with the reduced ones at the end."""
    models: tuple[ReducedModelResults, ...]
    """One a configuration that the update uses."""
    rounds: tuple[str, ...]
    """What was found each time the search ended, a sentence each."""
