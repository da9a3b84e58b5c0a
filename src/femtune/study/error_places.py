"""Errors of the lower layers are given their place: a key of the study, or a line of the deck."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from femtune.errors import FemtuneError, FemtuneErrors, Where

if TYPE_CHECKING:
    from femtune.files.built_model import BuiltModel
    from femtune.files.study_file import ConfigurationEntry, StudyFile

_KEYS = {
    "configuration.unknown-element": ("elements_off",),
    "configuration.not-held": ("supports_removed",),
    "correlate.fixed-pair": ("pairs",),
}
"""Keys of a configuration to which an error points, by its code."""
_KINDS = {"unmeasured": ("shape", "dynamic")}
"""Kinds of residuals that a problem `residual.…` can belong to."""
_HINTS = {
    "model.unknown-node": "correct the number here, or add the GRID card to the deck",
    "model.component": "a grid point has X Y Z RX RY RZ (1 to 6), a scalar point has S (0)",
}
"""Hints for errors about grid points and components that a study names, by code."""


@contextmanager
def errors_at(where: Where) -> Iterator[None]:
    """Give `where` to errors that are raised inside without a place."""
    try:
        yield
    except FemtuneError as error:
        for one in _without_place(error):
            _place(one, where)
        raise


def _without_place(error: FemtuneError) -> list[FemtuneError]:
    errors = error.errors if isinstance(error, FemtuneErrors) else (error,)
    return [one for one in errors if not str(one.where or "")]


def _place(error: FemtuneError, where: Where) -> None:
    error.where = where
    error.hint = error.hint or _HINTS.get(error.code, "")


@contextmanager
def errors_at_residuals(file: StudyFile) -> Iterator[None]:
    """Errors about residuals point to the residual at fault where the code tells its kind, else to the first one."""
    try:
        yield
    except FemtuneError as error:
        for one in _without_place(error):
            _place(one, _residual_at_fault(file, one.code))
        raise


def _residual_at_fault(file: StudyFile, code: str) -> Where:
    for comparison in file.comparisons:
        if comparison.entry.kind in _KINDS.get(code.removeprefix("residual."), ()):
            return file.where(*comparison.place, *(["shape_sd"] if comparison.short else []))
    return file.where(*(("residual",) if file.residual else ("residuals", "frequency_sd")))


def place_of(file: StudyFile, entry: ConfigurationEntry, *keys: str | int) -> Where:
    """Place of a key of a configuration: in its [[configuration]], or in [test] of a study without."""
    if file.configuration:
        return file.where("configuration", file.configurations.index(entry), *keys)
    return file.where("test", *("file" if key == "test" else key for key in keys))


@contextmanager
def errors_at_configuration(file: StudyFile, entry: ConfigurationEntry, *otherwise: str) -> Iterator[None]:
    """Errors about a configuration point to the key at fault, or to another one, or to the configuration."""
    try:
        yield
    except FemtuneError as error:
        for one in _without_place(error):
            _place(one, place_of(file, entry, *_KEYS.get(one.code, otherwise)))
        raise


@contextmanager
def errors_at_grid(built: BuiltModel) -> Iterator[None]:
    """Errors of the eigen-solution point to the grid point that moves where one is named, else to the main file."""
    try:
        yield
    except FemtuneError as error:
        if error.code.startswith("eigen.") and not str(error.where or ""):
            error.where = built.place_of_grid(error.facts.get("grid"))
        raise
