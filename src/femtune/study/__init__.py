"""A study as a whole: its files put together, the steps, and the results with their provenance."""

from femtune.study.cases import StudyCase
from femtune.study.load import Study, load_study
from femtune.study.results import Results, json_schema
from femtune.study.run_folder import read_results, write_results
from femtune.study.steps import RunFolder, correlate, info, modes, select, update

__all__ = [
    "Results",
    "RunFolder",
    "Study",
    "StudyCase",
    "correlate",
    "info",
    "json_schema",
    "load_study",
    "modes",
    "read_results",
    "select",
    "update",
    "write_results",
]
