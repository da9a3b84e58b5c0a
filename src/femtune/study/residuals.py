"""Residuals of a configuration: what the study compares in it."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import scipy.sparse as sp

from femtune.correlation import sensor_placement
from femtune.errors import ErrorCollector, FemtuneError, Notice, Where, did_you_mean
from femtune.files.study_file.residual import FrfResidual as FrfEntry
from femtune.identification import check_equalised_lines, equalised_test
from femtune.kinds import loaded
from femtune.residuals import ByMode, OfModes, OfPairs, PairResidual, Residual, case_without_modes
from femtune.residuals.frf.lines import Band
from femtune.residuals.own import own_residual
from femtune.study.axes import named_axis, sensor_axis
from femtune.study.error_places import errors_at
from femtune.study.identified_test import identification_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from femtune.arrays import Reals
    from femtune.correlation import SensorPlacement
    from femtune.dofs import DofSet
    from femtune.files.study_file import Comparison, StudyFile
    from femtune.identification import EqualisedTest
    from femtune.modal import FrfSet, ModeSet
    from femtune.model import ModalDamping
    from femtune.residuals import ComparedCase
    from femtune.study.cases import StudyCase


@dataclass(frozen=True, eq=False)
class AskedOf:
    """One comparison of a study in one configuration, as `femtune.residuals.asked.Asked` describes it."""

    file: StudyFile
    case: StudyCase
    comparison: Comparison
    damping: ModalDamping | None = None
    shared: dict[str, EqualisedTest] = field(default_factory=dict, repr=False)

    @property
    def entry(self) -> Any:
        """The table, of its kind."""
        return self.comparison.entry

    @property
    def name(self) -> str:
        """Name of the configuration."""
        return self.case.name

    @property
    def short(self) -> bool:
        """True if it is a key of [residuals]."""
        return self.comparison.short

    @property
    def of_largest(self) -> bool:
        """Whether the standard deviation of shapes is relative to the largest entry of each."""
        return self.comparison.of_largest

    @property
    def modes(self) -> ModeSet:
        """The modes of the configuration's test (error ``study.no-test``)."""
        if self.tested is None:
            raise FemtuneError("study.no-test/residual", where=self.where(), configuration=self.case.name)
        return self.tested

    @property
    def tested(self) -> ModeSet | None:
        """The modes of the configuration's test; None if there are none."""
        return None if self.case.modal is None else self.case.modal.test

    @property
    def frfs(self) -> FrfSet | None:
        """The measured FRFs, NaN where they are held out."""
        return self.case.used_frfs

    @property
    def decay(self) -> float:
        """1/τ of the exponential window of the measured FRFs in rad/s; 0 without one."""
        return 0.0 if self.case.test is None else self.case.test.decay

    def equalised(self, rigid: Callable[[FrfSet], ModeSet] | None = None) -> EqualisedTest | None:
        """The measured FRFs with equal damping ratios, if the study has [equalise]; they are identified once."""
        table, test = self.file.equalise, self.case.test
        if table is None or test is None or test.frfs is None:
            return None
        if "equalised" not in self.shared:
            with errors_at(self.file.where("equalise", "rigid_body")):
                modes = rigid(test.frfs) if table.rigid_body and rigid is not None else None
            with errors_at(self.file.where("equalise")):
                asked = identification_of(self.file, test, modes)
                equalised = equalised_test(test.frfs, table.damping, asked, table.lines, table.leave_out_hz)
            self.shared["equalised"] = replace(equalised, frfs=self.case.without_held(equalised.frfs))
        return self.shared["equalised"]

    @property
    def placement(self) -> SensorPlacement | None:
        """Errors in the placement of the sensors."""
        return self.case.placement

    def in_band(self, low_hz: float, high_hz: float) -> AskedOf:
        """The table with `from_hz` and `to_hz` limited to a band."""
        entry = self.entry
        top = high_hz if entry.to_hz is None else min(entry.to_hz, high_hz)
        limits = {"from_hz": max(entry.from_hz, low_hz), "to_hz": top if math.isfinite(top) else None}
        return replace(self, comparison=replace(self.comparison, entry=entry.model_copy(update=limits)))

    def where(self, *keys: str | int) -> Where:
        """Place of the table, or of one of its keys."""
        return self.file.where(*self.comparison.place, *keys)

    def errors_at(self, *keys: str | int) -> AbstractContextManager[None]:
        """Errors that are raised inside without a place get this one."""
        return errors_at(self.where(*keys))

    def rows(self, key: str) -> sp.csr_array:
        """(n, n_g) the DOFs that the labels under a key name."""
        return named_axis(self.file, self.case, tuple(getattr(self.entry, key)), *self.comparison.place, key).rows

    def seen(self, wanted: DofSet) -> tuple[DofSet, sp.csr_array, tuple[Notice, ...]]:
        """DOFs of the test that exist in the model and can move, their rows, and notices of the others."""
        axis, notices = sensor_axis(self.case, wanted)
        return axis.labels, axis.rows, notices


def with_residuals(file: StudyFile, case: StudyCase, damping: ModalDamping | None = None) -> StudyCase:
    """The configuration with the residuals that the study asks for in it; `damping` of modes is that of the deck.

    Raises
    ------
    FemtuneError : ``study.no-test``, ``study.unknown-mode``, ``residual.*``, ``response.held-port``,
        ``model.unknown-node`` …; several are shown together
    """
    case = replace(case, placement=placement_of(file, case))
    errors, short, separate = ErrorCollector(), list[Residual](), list[Residual]()
    lines_hz: Reals | None = None
    with errors.catch():
        lines_hz = _compared_lines(file, case)
    shared: dict[str, EqualisedTest] = {}
    mine = [c for c in file.comparisons if _is_of(c, case)]
    for comparison in mine:
        asked = AskedOf(file, case, comparison, damping, shared)
        with errors.catch(), asked.errors_at():
            _check_keys(file, comparison.entry)
            _check_band(comparison.entry, lines_hz)
            (short if comparison.short else separate).append(_built(asked))
    errors.raise_if_any()
    # the state that they are asked at says of which configuration it is
    separate.extend(map(own_residual, file.given.residuals))
    # [residuals] compares mode by mode, before all others
    by_mode = ByMode(tuple(cast(PairResidual, r) for r in short))
    residuals = (by_mode, *separate) if short else tuple(separate)
    if not residuals:
        return case
    scaled = any(getattr(c.entry, "mass_scaled", False) for c in mine)
    return replace(case, compared=_compared(file, case, residuals, scaled))


def _compared_lines(file: StudyFile, case: StudyCase) -> Reals | None:
    """Lines from which FRF residuals choose theirs; None without FRFs.

    Bands and lines of [equalise] that the test does not have are refused, before anything is identified or solved.
    """
    table, compares = file.equalise, any(isinstance(c.entry, FrfEntry) and _is_of(c, case) for c in file.comparisons)
    if not compares or case.test is None or case.test.frfs is None:
        return None
    if table is None:
        return case.test.frfs.freq_hz
    with errors_at(file.where("equalise")):
        # its options are checked
        identification_of(file, case.test)
        return check_equalised_lines(case.test.frfs, table.damping, table.band_hz, table.lines, table.not_compared_hz)


def _check_band(entry: object, lines_hz: Reals | None) -> None:
    """Refuse a band of FRFs without lines (error ``residual.no-frf-lines``)."""
    if isinstance(entry, FrfEntry) and entry.around == "band" and lines_hz is not None:
        Band(entry.from_hz, np.inf if entry.to_hz is None else entry.to_hz, entry.most).regions(lines_hz)


def _check_keys(file: StudyFile, entry: object) -> None:
    """Refuse keys of FRFs that [equalise] leaves without a meaning (error ``residual.equalised-keys``)."""
    if file.equalise is None or not isinstance(entry, FrfEntry):
        return
    if entry.ratio is not None or entry.ratios is not None or entry.averages is not None:
        raise FemtuneError("residual.equalised-keys")


def undamped_functions(
    file: StudyFile, cases: Sequence[StudyCase], free: int, damping: ModalDamping | None
) -> Iterator[Notice]:
    """Warnings of FRFs that are compared with those of a model without damping, before anything is solved.

    Parameters
    ----------
    cases : the configurations of the study `file`
    free : number of parameters that an update changes
    damping : modal damping of the deck, if it has any
    """
    from femtune.residuals.frf.asked import stated_damping, undamped  # noqa: PLC0415  few studies compare FRFs

    for case in cases if file.equalise is None else ():
        of_case = (c.entry for c in file.comparisons if _is_of(c, case))
        functions = [entry for entry in of_case if isinstance(entry, FrfEntry)]
        if functions:
            point = case.configured.at(np.zeros(free))
            of_functions = (stated_damping(entry, damping) for entry in functions)
            yield from dict.fromkeys(notice for one in of_functions for notice in undamped(case.name, point, one))


_QUANTITIES = {
    "frequency": "frequencies", "shape": "shapes", "strain": "strain shapes", "damping": "damping ratios",
    "complex-eigenvalue": "frequencies and damping ratios",
}  # fmt: skip
"""Quantities of residuals of modes in messages."""


def modes_without_sd(file: StudyFile, case: StudyCase) -> tuple[Notice, ...]:
    """A warning for each residual that uses the standard deviations of the test, if these lack modes that may be
    paired."""
    if case.compared is None:
        return ()
    test, notices = case.compared.test, []
    for residual in case.compared.residuals:
        lacking = residual.without_sd(test) if isinstance(residual, OfPairs) else ()
        labels = [test.labels[i] for i in lacking if i not in case.compared.left_out]
        if labels:
            some = ", ".join(labels[:8]) + (" …" if len(labels) > 8 else "")
            place = Where(str(file.path))
            quantity = _QUANTITIES.get(residual.key, residual.label)
            notices.append(
                Notice(
                    "residual.no-scatter/of-modes", where=place, configuration=case.name, modes=some, quantity=quantity
                )
            )
    return tuple(dict.fromkeys(notices))


def placement_of(file: StudyFile, case: StudyCase) -> SensorPlacement | None:
    """Errors in the placement of the sensors of the modes, where [sensors] states them."""
    table = file.sensors
    if (
        case.modal is None
        or case.sensors is None
        or not case.sensors.matches
        or (not table.position_sd and not table.angle_sd_deg)
    ):
        return None
    return sensor_placement(case.configured, case.sensors, table.position_sd, _radians(table.angle_sd_deg))


def check_placement(file: StudyFile, cases: Sequence[StudyCase]) -> None:
    """Refuse test nodes in [sensors] that have no sensor in any configuration (error ``sensor.placement-unknown``)."""
    known = {m.label.node for case in cases if case.modal and case.sensors for m in case.sensors.matches}
    for key in ("position_sd", "angle_sd_deg"):
        given = getattr(file.sensors, key)
        unknown = sorted(set(given) - known) if isinstance(given, dict) else []
        if unknown:
            nodes = ", ".join(map(str, unknown[:10]))
            raise FemtuneError("sensor.placement-unknown", where=file.where("sensors", key), nodes=nodes)


def _radians(degrees: float | dict[int, float]) -> float | dict[int, float]:
    factor = math.pi / 180.0
    return {n: factor * d for n, d in degrees.items()} if isinstance(degrees, dict) else factor * degrees


def _is_of(comparison: Comparison, case: StudyCase) -> bool:
    """[residuals] applies to all configurations with modes that the update uses, a [[residual]] to its own."""
    if comparison.short:
        return case.modal is not None and case.entry.use == "update"
    several, used = case.entry.specimen is not None, case.entry.use == "update"
    return comparison.entry.is_in(case.name, several, used)


def _compared(file: StudyFile, case: StudyCase, residuals: tuple[Residual, ...], scaled: bool) -> ComparedCase:
    """What the update uses; `scaled` is True if the study states that the test's shapes are of unit modal mass."""
    if case.modal is None:
        return case_without_modes(case.configured, residuals, count=file.modes.count, max_hz=file.modes.max_hz)
    test = replace(case.modal.test, normalisation="mass") if scaled else case.modal.test
    return replace(case.modal, test=test, residuals=residuals)


def _built(asked: AskedOf) -> Residual:
    built: Residual = loaded(asked.entry.made_by).of_study(asked)
    labels = asked.entry.modes if isinstance(built, OfPairs) or built.of_modes else None
    for i, label in enumerate(labels or ()):
        if label not in asked.modes.labels:
            raise FemtuneError(
                "study.unknown-mode/residual",
                where=asked.where("modes", i),
                hint=did_you_mean(label, asked.modes.labels),
                configuration=asked.name,
                label=label,
            )
    return OfModes(built, labels) if labels is not None and isinstance(built, OfPairs) else built
