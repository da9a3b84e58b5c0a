"""What to write into the study if the sensors of a test do not lie at grid points: units, axes, tolerance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.correlation.guessed_sensors import guess_sensors
from femtune.correlation.sensor_map import length_factor
from femtune.errors import FemtuneError
from femtune.units import unit_system

if TYPE_CHECKING:
    from femtune.fem import Structure
    from femtune.files.study_file import ConfigurationEntry, StudyFile
    from femtune.testdata import ModalTest

_SYSTEMS = ("m-kg-s", "mm-t-s", "cm-kg-s", "in-slinch-s", "ft-slug-s")
"""One system for each unit of length."""
_SAME_UNIT = 0.03
"""Relative difference of two lengths below which they are the same unit. It covers the inexact fit of sensors to grid
points; neighbouring units differ by a factor of 2.5 and more."""


@contextmanager
def with_keys(file: StudyFile, entry: ConfigurationEntry, test: ModalTest, structure: Structure) -> Iterator[None]:
    """Errors of sensors without a grid point state the keys of the study that would place them at grid points, if any
    do."""
    try:
        yield
    except FemtuneError as error:
        if error.code in ("sensor.unmatched", "sensor.one-grid", "sensor.too-far"):
            hint = units_hint(file, entry, test, structure) or _axes_hint(file, test, structure)
            error.hint = hint or error.hint
        raise


def units_hint(file: StudyFile, entry: ConfigurationEntry, test: ModalTest, structure: Structure) -> str:
    """The unit of length of the test for which its points lie at grid points, with the key; "" if there is none."""
    points = _points(test)[1]
    factor, words = length_factor(points, structure.nodes)
    if not words:
        return ""
    study = file.study.unit_system
    of_test = named_length(factor * study.length)
    if entry.test_units is not None and of_test:
        table, key = ("[[configuration]]", "test_units") if file.configuration else ("[test]", "units")
        return f'{words}: write {key} = "{of_test}" in {table}'
    of_deck = named_length(study.length / factor)
    told = f'{words}: if the deck is in another unit, write units = "{of_deck}" in [study]' if of_deck else words
    return f"{told}; if the file of the test states a wrong unit, correct its data set 164"


def named_length(length: float) -> str:
    """The system with such a unit of length in metres; "" if there is none."""
    systems = (name for name in _SYSTEMS if abs(unit_system(name).length / length - 1.0) <= _SAME_UNIT)
    return next(systems, "")


def _axes_hint(file: StudyFile, test: ModalTest, structure: Structure) -> str:
    """Rotation and origin of the test for which its points lie at grid points, as keys; "" if there are none."""
    numbers, points = _points(test)
    guess = guess_sensors(structure, numbers, points)
    table = "[[configuration]]" if file.configuration else "[test]"
    written = [f"{_keys(keys)} in {name}" for keys, name in ((guess.test, table), (guess.sensors, "[sensors]")) if keys]
    if not guess.found or not written:
        return ""
    told = "the axes of the test differ from those of the model" if guess.test else guess.words
    several = f"; {guess.several}" if guess.several else ""
    return f"{told}: write {' and '.join(written)}{several}"


def _keys(table: Mapping[str, Any]) -> str:
    """Keys as a TOML file has them."""
    return " and ".join(f"{key} = {str(value).lower() if value is True else value}" for key, value in table.items())


def _points(test: ModalTest) -> tuple[np.ndarray, np.ndarray]:
    """(n,) numbers and (n, 3) places of the points with sensors."""
    places = {s.label.node: s.position for s in test.sensors if np.isfinite(s.position).all()}
    return np.array(list(places), int), np.array(list(places.values()), float).reshape(-1, 3)
