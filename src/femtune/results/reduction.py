"""The reduced models of an update, as records."""

from __future__ import annotations

from femtune.results.base import Record


class ReducedModelResults(Record):
    """The reduced model of one configuration."""

    configuration: str
    """Name of the configuration."""
    order: int
    """Its final order."""
    full_solutions: int
    """How many times the full model was solved for its modes to train the model, and where each search ended. The modes
    of the comparison before the update and of the written deck, and derivatives at the end, come on top."""
    estimate_percent: float
    """Largest estimated error of a frequency in the box of the parameters when the search began, in %."""
    certified_error_percent: float
    """Largest true error of a frequency at the end of the search, in %, for the model used in the search."""
    training: str
    """The outcome of the training, in a sentence."""


class ReductionResults(Record):
    """An update with reduced models."""

    tolerance_percent: float
    """Largest error of a frequency that the study allows at the end, in %."""
    certified: bool
    """True if full and reduced models agree at the final point."""
    models: tuple[ReducedModelResults, ...]
    """One per configuration of the update."""
    rounds: tuple[str, ...]
    """The comparison with the full model at the end of each search, a sentence each."""
