"""Residuals of a configuration, from the [[residual]] tables of the study."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.dofs import Dof, DofSet, parse_dof
from femtune.errors import ErrorCollector, FemtuneError, Where, did_you_mean
from femtune.files.study_file import StudyFile
from femtune.files.study_file.residual import (
    CentreResidualEntry,
    DisplacementResidualEntry,
    DynamicResidualEntry,
    FlexibilityResidualEntry,
    ForceResidualEntry,
    FrequencyResidualEntry,
    InertiaResidualEntry,
    MacResidualEntry,
    MassResidualEntry,
    OfModesTable,
    ShapeResidualEntry,
    StrainResidualEntry,
)
from femtune.files.study_file.residual_frf import AntiresonanceResidualEntry, FrfResidualEntry
from femtune.files.study_file.table import Table
from femtune.modal import ModeSet
from femtune.model import ModalDamping
from femtune.residuals import ModalCase, OfModes, OfPairs, Residual, case_without_modes
from femtune.residuals.dynamic import DynamicResidual
from femtune.residuals.flexibility import FlexibilityResidual
from femtune.residuals.frequency import FrequencyCovariance, FrequencyResidual
from femtune.residuals.mac import MacResidual
from femtune.residuals.mass import CentreResidual, InertiaResidual, MassResidual
from femtune.residuals.shape import ShapeResidual
from femtune.residuals.static import DisplacementResidual, ForceResidual, StaticTest
from femtune.residuals.weights import Weights
from femtune.study.cases import StudyCase
from femtune.study.frf_residuals import antiresonance_comparison, frf_comparison
from femtune.study.located import located
from femtune.study.response_axes import named_axis

_UNKNOWN = float("nan")


@dataclass(frozen=True, eq=False)
class Asked:
    """One [[residual]] of a study, and the configuration that it belongs to; `damping` of modes is that of the deck."""

    file: StudyFile
    case: StudyCase
    position: int
    damping: ModalDamping | None = None

    @property
    def entry(self) -> Any:
        """The table, of its kind."""
        return self.file.residual[self.position]

    def where(self, *keys: str | int) -> Where:
        """Where the table, or one of its keys, stands."""
        return self.file.where("residual", self.position, *keys)

    @property
    def modes(self) -> ModeSet:
        """The modes of the configuration's test (error ``study.no-test``)."""
        if self.case.modal is None:
            raise FemtuneError(
                "study.no-test",
                f"configuration {self.case.name} has no test with modes, and this residual compares them",
                where=self.where(),
                hint='give the configuration test = "file.uff" with modes (data sets 55), or take the residual out',
            )
        return self.case.modal.test


Builder = Callable[[Asked], Residual]


def with_residuals(file: StudyFile, case: StudyCase, damping: ModalDamping | None = None) -> StudyCase:
    """The configuration with the residuals that the study asks for in it.

    Raises
    ------
    FemtuneError : ``study.no-test``, ``study.unknown-mode``, ``residual.*``, ``response.held-port``,
        ``model.unknown-node`` …; several are shown together
    """
    mine = [i for i, entry in enumerate(file.residual) if entry.configuration in (None, case.name)]
    errors, found = ErrorCollector(), list[Residual]()
    for i in mine:
        asked = Asked(file, case, i, damping)
        with errors.catch(), located(asked.where()):
            found.append(_built(asked))
    errors.raise_if_any()
    if not found:
        return case
    scaled = any(getattr(file.residual[i], "mass_scaled", False) for i in mine)
    return replace(case, compared=_compared(file, case, tuple(found), scaled))


def _compared(file: StudyFile, case: StudyCase, residuals: tuple[Residual, ...], scaled: bool) -> ModalCase:
    """What the update uses; `scaled` where the study says that the test's shapes are of unit modal mass."""
    if case.modal is None:
        return case_without_modes(case.configured, residuals, count=file.modes.wanted, max_hz=file.modes.max_hz)
    test = replace(case.modal.test, normalisation="mass") if scaled else case.modal.test
    return replace(case.modal, test=test, residuals=residuals)


def _built(asked: Asked) -> Residual:
    built = BUILDERS[type(asked.entry)](asked)
    labels = asked.entry.modes if isinstance(asked.entry, OfModesTable) else None
    if labels is None:
        return built
    for i, label in enumerate(labels):
        if label not in asked.modes.labels:
            raise FemtuneError(
                "study.unknown-mode",
                f"configuration {asked.case.name}: no mode of the test is called '{label}'",
                where=asked.where("modes", i),
                hint=did_you_mean(label, asked.modes.labels),
            )
    return OfModes(built, labels) if isinstance(built, OfPairs) else built


def _frequency(asked: Asked) -> Residual:
    entry = asked.entry
    if entry.covariance is None:
        if entry.sd == "test":
            _check_scatter(asked, asked.modes.freq_sd_hz, "sd")
        _ = asked.modes
        return FrequencyResidual(entry.sd, entry.form)
    if entry.covariance == "test":
        _check_scatter(asked, asked.modes.covariance, "covariance")
        return FrequencyCovariance("test", entry.form)
    return FrequencyCovariance(_matrix(asked, len(asked.modes), "the modes of the test"), entry.form)


def _check_scatter(asked: Asked, known: NDArray[np.float64] | None, key: str) -> None:
    if known is None:
        raise FemtuneError(
            "residual.no-scatter",
            f"configuration {asked.case.name}: the test gives no scatter of its frequencies",
            where=asked.where(key),
            hint="give sd a number, or covariance a matrix",
        )


def _matrix(asked: Asked, n: int, what: str) -> NDArray[np.float64]:
    """A covariance of n values."""
    with located(asked.where("covariance")):
        matrix = np.array(asked.entry.covariance, dtype=float)
        Weights(covariance=matrix).check_size(n, what)
    return matrix


def _weights(asked: Asked, n: int, what: str, size: float = 1.0) -> Weights:
    """A standard deviation relative to a size, or a covariance."""
    if asked.entry.covariance is not None:
        return Weights(covariance=_matrix(asked, n, what))
    return Weights(asked.entry.sd * size)


def _shape(asked: Asked) -> Residual:
    entry, dofs = asked.entry, asked.modes.dofs
    if entry.scaling == "mass":
        _check_mass_scaled(asked)
    sensors = dofs if entry.sensors is None else DofSet(_sensors(asked, entry.sensors))
    return ShapeResidual(_weights(asked, len(sensors), "the sensors"), entry.scaling, sensors, entry.kind)


def _sensors(asked: Asked, labels: Iterable[str]) -> Iterable[Dof]:
    """Sensors of the test's modes."""
    known = {(d.node, d.direction): d for d in asked.modes.dofs}
    for i, label in enumerate(labels):
        dof = parse_dof(label)
        if (dof.node, dof.direction) not in known:
            raise FemtuneError(
                "dof.missing",
                f"configuration {asked.case.name}: the test's modes have no {label}, or it has no place in the model",
                where=asked.where("sensors", i),
                hint=did_you_mean(label, map(str, asked.modes.dofs)),
            )
        yield known[dof.node, dof.direction]


def _mac(asked: Asked) -> Residual:
    _ = asked.modes
    return MacResidual(asked.entry.sd, asked.entry.form, "MAC")


def _check_mass_scaled(asked: Asked) -> None:
    if asked.modes.normalisation != "mass" and not asked.entry.mass_scaled:
        raise FemtuneError(
            "residual.not-mass-scaled",
            f"configuration {asked.case.name}: the test's shapes are not mass-normalised, and this residual needs it",
            where=asked.where(),
            values={"normalisation of the test": asked.modes.normalisation},
            hint="write mass_scaled = true if they are, or take a residual that needs none",
        )


def _flexibility(asked: Asked) -> Residual:
    _check_mass_scaled(asked)
    return FlexibilityResidual(asked.entry.sd, asked.entry.part)


def _dynamic(asked: Asked) -> Residual:
    _ = asked.modes
    return DynamicResidual(asked.entry.sd, asked.entry.modes)


def _displacement(asked: Asked) -> Residual:
    test = _static(asked)
    return DisplacementResidual(test, _weights(asked, len(test.measured), "the displacements", test.size))


def _force(asked: Asked) -> Residual:
    return ForceResidual(_static(asked), asked.entry.sd)


def _static(asked: Asked) -> StaticTest:
    entry, place = asked.entry, ("residual", asked.position)
    forces = named_axis(asked.file, asked.case, tuple(entry.forces), *place, "forces")
    seen = named_axis(asked.file, asked.case, tuple(entry.displacements), *place, "displacements")
    load = sp.csr_array(sp.csr_array(np.array([list(entry.forces.values())])) @ forces.rows)
    if not np.any(load.data):
        raise FemtuneError(
            "response.zero-load",
            f"the forces of {entry.name} are zero, or cancel each other",
            where=asked.where("forces"),
            hint="give it a force, or take the residual out",
        )
    with located(asked.where("displacements")):
        return StaticTest(entry.name, load, seen.rows, np.array(list(entry.displacements.values())))


def _mass(asked: Asked) -> Residual:
    return MassResidual(asked.entry.mass, Weights(asked.entry.sd * asked.entry.mass))


def _centre(asked: Asked) -> Residual:
    given = [getattr(asked.entry, axis) for axis in "xyz"]
    return CentreResidual(np.array(_numbers(given)), Weights(asked.entry.sd))


def _inertia(asked: Asked) -> Residual:
    names = (("xx", "xy", "xz"), ("xy", "yy", "yz"), ("xz", "yz", "zz"))
    matrix = np.array([_numbers([getattr(asked.entry, f"i{name}") for name in row]) for row in names])
    size = float(np.nanmax(np.abs(matrix), initial=0.0)) or 1.0
    return InertiaResidual(matrix, asked.entry.about, Weights(asked.entry.sd * size))


def _numbers(values: Iterable[float | None]) -> list[float]:
    """NaN for what was not measured."""
    return [_UNKNOWN if value is None else value for value in values]


def _frf(asked: Asked) -> Residual:
    modes = None if asked.case.modal is None else asked.case.modal.test
    return frf_comparison(asked.entry, asked.case, asked.where, asked.damping, modes)


def _antiresonance(asked: Asked) -> Residual:
    return antiresonance_comparison(asked.entry, asked.case, asked.where)


BUILDERS: Mapping[type[Table], Builder] = {
    FrequencyResidualEntry: _frequency,
    ShapeResidualEntry: _shape,
    StrainResidualEntry: _shape,
    MacResidualEntry: _mac,
    FlexibilityResidualEntry: _flexibility,
    DynamicResidualEntry: _dynamic,
    DisplacementResidualEntry: _displacement,
    ForceResidualEntry: _force,
    MassResidualEntry: _mass,
    CentreResidualEntry: _centre,
    InertiaResidualEntry: _inertia,
    FrfResidualEntry: _frf,
    AntiresonanceResidualEntry: _antiresonance,
}
"""By the table of the kind."""
