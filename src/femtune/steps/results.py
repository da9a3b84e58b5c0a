"""The results of a study: a documented, versioned schema that is independent of the code.

``results.json`` holds one `Results`; arrays are beside it in ``arrays.npz`` and are referred to by key.
docs/results-schema.md lists every field.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Literal, get_args

from femtune.docstrings import attribute_docstrings
from femtune.steps.bootstrap.record import BootstrapResults
from femtune.steps.candidates.record import CandidatesResults
from femtune.steps.correlate.record.correlation import CorrelationResults
from femtune.steps.equalise.record import MappedDamping
from femtune.steps.info.record.model import ModelFacts, ModelModes, SensorResults
from femtune.steps.intervals.record import IntervalPredictions
from femtune.steps.judge.record.judgement import JudgementResults
from femtune.steps.live.record import LiveResults
from femtune.steps.modes.record import ModeShapes
from femtune.steps.plan.record import PlanResults
from femtune.steps.posterior.record import PosteriorResults
from femtune.steps.quantify.record import QuantifyResults
from femtune.steps.respond.record import ResponseResults
from femtune.steps.screen.record import ScreenResults
from femtune.steps.search.record import GlobalSearchResults
from femtune.steps.select.record.identifiability import SelectionResults
from femtune.steps.specimens.record import SpecimenResults
from femtune.steps.update.record.update import ParameterFacts, UpdateResults
from femtune.steps.validate.record.validation import ValidationResults
from femtune.steps.write.record import WriteBackResults
from femtune.study.record import Alert, CitationRecord, JournalResults, Provenance, Record, StudyFacts

if TYPE_CHECKING:
    from femtune.steps.info.record.checks import ModelCheck


SCHEMA_VERSION = "2"


class Results(Record):
    """All results of a run; steps that did not run are None."""

    schema_version: Literal["2"] = "2"
    """Version of this schema."""
    provenance: Provenance
    """Origin of the results."""
    study: StudyFacts
    """Title, units and files of the study."""
    model: ModelFacts | None = None
    """Deck and model; None if the run stopped before the model was built."""
    sensors: tuple[SensorResults, ...] = ()
    """One record a configuration."""
    parameters: tuple[ParameterFacts, ...] = ()
    """Parameters of the study."""
    modes: tuple[ModelModes, ...] = ()
    """Solved modes by configuration and model version."""
    correlations: tuple[CorrelationResults, ...] = ()
    """Test against model by configuration and model version."""
    mode_shapes: tuple[ModeShapes, ...] = ()
    """Shapes for drawing, by configuration, before the update and at the last model version."""
    responses: tuple[ResponseResults, ...] = ()
    """Frequency responses, complex modes and static displacements, by configuration and model version."""
    plan: PlanResults | None = None
    """A planned test; None if not run. `femtune run` makes none."""
    intervals: IntervalPredictions | None = None
    """Extreme frequencies of a box of parameters; None if not run. `femtune run` makes none."""
    screen: ScreenResults | None = None
    """Effects of the parameters by designed runs; None if not run. `femtune run` makes none."""
    search: GlobalSearchResults | None = None
    """A search of the whole box; None if not run. `femtune run` makes none."""
    candidates: CandidatesResults | None = None
    """Comparison of candidate models; None if not run. `femtune run` makes none."""
    selection: SelectionResults | None = None
    """Identifiability; None if not run."""
    update: UpdateResults | None = None
    """The update; None if not run."""
    quantify: QuantifyResults | None = None
    """Variability of the parameters from repeated tests; None if the study has no [quantify]."""
    bootstrap: BootstrapResults | None = None
    """Spread of the parameters by a bootstrap of the FRFs; None if the study has no [bootstrap]."""
    posterior: PosteriorResults | None = None
    """Sampled distribution of the parameters; None if the study has no [posterior]."""
    live: LiveResults | None = None
    """The model that a reader of the report can change; None if the study wants none, and in older results."""
    specimens: SpecimenResults | None = None
    """Nominally identical specimens, calibrated jointly and separately; None if the study has none."""
    mapped_damping: tuple[MappedDamping, ...] = ()
    """Measured damping on the modes of the updated model, by configuration; empty without [equalise]."""
    write_back: WriteBackResults | None = None
    """The updated deck; None if none was written."""
    validation: ValidationResults | None = None
    """Validation on data that were not used; None if not run."""
    judgement: JudgementResults | None = None
    """The verdict on the run; None if the run did not end, and in older results."""
    journal: JournalResults | None = None
    """Solutions of the full model, solved and recalled; None without a journal."""
    citations: tuple[CitationRecord, ...] = ()
    """Publications on the methods used outside the update."""
    alerts: tuple[Alert, ...] = ()
    """Alerts."""

    @property
    def model_checks(self) -> tuple[ModelCheck, ...]:
        """Checks for errors that updating cannot correct: with modes if available, otherwise the mass only."""
        if self.selection is not None and self.selection.model_checks:
            return self.selection.model_checks
        return self.model.checks if self.model is not None else ()

    def array_keys(self) -> tuple[str, ...]:
        """Keys in arrays.npz that these results refer to, of all records."""
        return tuple(dict.fromkeys(_array_keys(self)))


def _array_keys(part: object) -> Iterator[str]:
    """The keys of a record and of all its parts: the values of fields whose names end with "_key"."""
    if isinstance(part, Record):
        for name, value in part:
            if name.endswith("_key") and isinstance(value, str):
                yield value
            else:
                yield from _array_keys(value)
    elif isinstance(part, tuple):
        for one in part:
            yield from _array_keys(one)


def json_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of ``results.json``, with the description of every field."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **Results.model_json_schema()}
    for record in record_types():
        properties = (schema if record is Results else schema["$defs"][record.__name__])["properties"]
        for name, text in attribute_docstrings(record).items():
            properties[name]["description"] = text
    return schema


def record_types() -> tuple[type[Record], ...]:
    """All record types of the schema, `Results` first, each before its parts."""
    return tuple(dict.fromkeys(_with_parts(Results)))


def _with_parts(annotation: Any) -> Iterator[type[Record]]:
    """The records of a type, and of all that their fields are made of."""
    if isinstance(annotation, type) and issubclass(annotation, Record):
        yield annotation
        for field in annotation.model_fields.values():
            yield from _with_parts(field.annotation)
    else:
        for part in get_args(annotation):
            yield from _with_parts(part)
