"""Sections of the report, one small file each: a function from the source to blocks."""

from collections.abc import Callable

from femtune.report.document import Block
from femtune.report.sections.checks import checks
from femtune.report.sections.comac import comac
from femtune.report.sections.compared import compared
from femtune.report.sections.complex_modes import complex_modes
from femtune.report.sections.convergence import convergence
from femtune.report.sections.criteria import criteria
from femtune.report.sections.identifiability import identifiability
from femtune.report.sections.mac import mac
from femtune.report.sections.method import method
from femtune.report.sections.mode_shapes import mode_shapes
from femtune.report.sections.model_summary import model_summary
from femtune.report.sections.modes import modes
from femtune.report.sections.natural_modes import natural_modes
from femtune.report.sections.parameters import parameters
from femtune.report.sections.pictures import pictures
from femtune.report.sections.provenance import provenance
from femtune.report.sections.quantify import quantify
from femtune.report.sections.responses import frequency_responses, responses
from femtune.report.sections.static_loads import static_loads
from femtune.report.sections.summary import summary
from femtune.report.sections.validation import validation
from femtune.report.sections.write_back import write_back
from femtune.report.source import Source

BUILDERS: dict[str, Callable[[Source], list[Block]]] = {
    "summary": summary,
    "compared": compared,
    "modes": modes,
    "mode_shapes": mode_shapes,
    "mac": mac,
    "comac": comac,
    "responses": responses,
    "parameters": parameters,
    "convergence": convergence,
    "identifiability": identifiability,
    "quantify": quantify,
    "validation": validation,
    "checks": checks,
    "write_back": write_back,
    "criteria": criteria,
    "method": method,
    "provenance": provenance,
}
"""By the ids of text/report.toml."""

MODES_BUILDERS: dict[str, Callable[[Source], list[Block]]] = {
    "model_summary": model_summary,
    "natural_modes": natural_modes,
    "pictures": pictures,
    "checks": checks,
    "provenance": provenance,
}
"""By the ids of text/modes.toml."""

RESPONSES_BUILDERS: dict[str, Callable[[Source], list[Block]]] = {
    "frequency_responses": frequency_responses,
    "complex_modes": complex_modes,
    "static_loads": static_loads,
    "provenance": provenance,
}
"""By the ids of text/responses.toml."""
