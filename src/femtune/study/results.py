"""The results of a study: a documented, versioned schema that outlives the code.

``results.json`` holds one `Results`; arrays lie beside it in ``arrays.npz`` and are referred to by key.
docs/results-schema.md lists every field.
"""

from __future__ import annotations

from typing import Any, Literal

from femtune.study import (
    results_base,
    results_checks,
    results_correlation,
    results_journal,
    results_model,
    results_quantify,
    results_reduction,
    results_response,
    results_search,
    results_select,
    results_shapes,
    results_stages,
    results_update,
    results_validation,
)
from femtune.study.results_base import Alert, Citation, Provenance, Record, StudyFacts
from femtune.study.results_checks import ModelCheck
from femtune.study.results_correlation import CorrelationResults
from femtune.study.results_journal import JournalResults
from femtune.study.results_model import ModelFacts, ModelModes, SensorResults
from femtune.study.results_quantify import QuantifyResults
from femtune.study.results_response import ResponseResults
from femtune.study.results_shapes import ModeShapes
from femtune.study.results_update import ParameterFacts, SelectionResults, UpdateResults, WriteBackResults
from femtune.study.results_validation import ValidationResults

SCHEMA_VERSION = "1"


class Results(Record):
    """Everything that a run found; a step that did not run is None."""

    schema_version: Literal["1"] = "1"
    """Version of this schema."""
    provenance: Provenance
    """Where the results come from."""
    study: StudyFacts
    """What the study says."""
    model: ModelFacts | None = None
    """Deck and model; None where the run stopped before it was built."""
    sensors: tuple[SensorResults, ...] = ()
    """One record a configuration."""
    parameters: tuple[ParameterFacts, ...] = ()
    """Parameters of the study."""
    modes: tuple[ModelModes, ...] = ()
    """Solved modes by configuration and stage."""
    correlations: tuple[CorrelationResults, ...] = ()
    """Test against model by configuration and stage."""
    mode_shapes: tuple[ModeShapes, ...] = ()
    """Shapes for drawing, by configuration, before the update and at the last stage."""
    responses: tuple[ResponseResults, ...] = ()
    """Frequency responses, complex modes and static displacements, by configuration and stage."""
    selection: SelectionResults | None = None
    """Identifiability; None where not run."""
    update: UpdateResults | None = None
    """The update; None where not run."""
    quantify: QuantifyResults | None = None
    """Scatter of the parameters from repeated tests; None where the study has no [quantify]."""
    write_back: WriteBackResults | None = None
    """The updated deck; None where nothing was written."""
    validation: ValidationResults | None = None
    """Data that were not used; None where not run."""
    journal: JournalResults | None = None
    """Solutions of the full model, solved and recalled; None where the study keeps no journal."""
    citations: tuple[Citation, ...] = ()
    """Publications behind what ran outside the update."""
    alerts: tuple[Alert, ...] = ()
    """What the reader should know first, typed."""

    @property
    def model_checks(self) -> tuple[ModelCheck, ...]:
        """What an update cannot mend: all that was checked with the modes, else what is known without them."""
        if self.selection is not None and self.selection.model_checks:
            return self.selection.model_checks
        return self.model.checks if self.model is not None else ()

    def array_keys(self) -> tuple[str, ...]:
        """Keys in arrays.npz that these results refer to."""
        frfs = (response.frfs for response in self.responses)
        single = [r for r in (self.selection, self.quantify, *frfs) if r is not None]
        owners: list[Record] = [*self.correlations, *self.mode_shapes, *single]
        found = (value for owner in owners for name, value in owner if name.endswith("_key"))
        return tuple(key for key in found if key is not None)


def json_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of ``results.json``, with the description of every field."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **Results.model_json_schema()}


def record_types() -> tuple[type[Record], ...]:
    """All record types of the schema, `Results` first, then in the order of their modules."""
    model = (results_checks, results_model, results_correlation, results_shapes, results_response)
    uses = (results_quantify, results_validation, results_reduction, results_search, results_stages, results_journal)
    modules = (results_base, *model, results_update, results_select, *uses)
    found = [value for module in modules for value in vars(module).values() if _is_record(value, module.__name__)]
    return (Results, *found)


def _is_record(value: object, module: str) -> bool:
    return isinstance(value, type) and issubclass(value, Record) and value is not Record and value.__module__ == module
