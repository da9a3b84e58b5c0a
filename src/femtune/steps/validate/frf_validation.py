"""Measured FRFs that the update did not use, compared with those of the model, as records."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.files.study_file import ResponseTable
from femtune.files.study_file.residual import FrfResidual as FrfResidualTable
from femtune.files.study_file.stage import RESONANCES
from femtune.modal.kinds import FrfKind
from femtune.model import damping_by_mode
from femtune.residuals.frf.antiresonance import AntiresonanceResidual
from femtune.residuals.frf.measured_damping import measured_damping
from femtune.residuals.frf.model_way import AtFirstState
from femtune.residuals.frf.residual import FrfResidual
from femtune.steps.correlate.criteria import of_frfs
from femtune.steps.correlate.facts import array_prefix
from femtune.steps.equalise.run import identified_residuals
from femtune.study.error_places import errors_at_grid
from femtune.study.progress import silent
from femtune.study.response import response_request, solved_frfs
from femtune.validation.frfs import PredictedFrfs

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.model import EigenSolution
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.study import Study
from femtune.steps.validate.record.frf_validation import PredictedCurves, PredictedFrf, PredictedResonance


@dataclass(frozen=True, eq=False)
class UnusedFrfs:
    """Measured FRFs of a configuration that the update did not use.

    Parameters
    ----------
    found : they and those of the model; None with the reason in `why`
    key : head of the keys of their arrays
    """

    case: StudyCase
    found: PredictedFrfs | None
    why: str = ""
    key: str = ""

    def keep(self, arrays: dict[str, NDArray]) -> None:
        """Put lines and values into the arrays of the results."""
        if self.found is not None:
            arrays[f"{self.key}_hz"] = self.found.freq_hz
            arrays[f"{self.key}_values"] = self.found.model
            arrays[f"{self.key}_test_values"] = self.found.test

    def curves(self, data: str) -> Iterable[PredictedCurves]:
        """The record of these arrays."""
        if self.found is not None and self.case.test is not None and self.case.test.frfs is not None:
            yield PredictedCurves(
                configuration=self.case.name,
                data=data,
                kind=cast("FrfKind", self.case.test.frfs.kind),
                outputs=tuple(self.found.outputs),
                inputs=tuple(self.found.inputs),
                freq_key=f"{self.key}_hz",
                values_key=f"{self.key}_values",
                test_values_key=f"{self.key}_test_values",
            )


def unused_frfs(
    study: Study, x: Reals, arrays: dict[str, NDArray], progress: Progress = silent
) -> tuple[UnusedFrfs, ...]:
    """Those of all configurations with a test, if the study compares FRFs or has criteria for them.

    What cannot be computed is not tested, with the reason: the update does not depend on it. Lines and values are put
    into `arrays`.
    """
    if not of_frfs(study) and not _entries(study):
        return ()
    cases, out = [c for c in study.cases if c.test is not None], []
    for i, case in enumerate(cases):
        progress.step(f"FRFs that were not used: {case.name}", i, len(cases))
        try:
            predicted = replace(_unused(study, case, x), key=f"{array_prefix('after', case.name, i + 1)}/unused_frf")
            predicted.keep(arrays)
            out.append(predicted)
        except FemtuneError as error:
            out.append(UnusedFrfs(case, None, f"{error.what} ({error.code})"))
    return tuple(out)


def check_frf_band(study: Study) -> None:
    """Check that measured lines lie within frf_from_hz and frf_to_hz of [validate], where the study gives them.

    Raises
    ------
    FemtuneError : ``response.no-lines/validation``
    """
    given = study.file.validation
    low, high = given.frf_from_hz, given.frf_to_hz
    measured = [case.test.frfs for case in study.cases if case.test is not None and case.test.frfs is not None]
    if (low is None and high is None) or not measured:
        return
    hz = np.concatenate([frfs.freq_hz for frfs in measured])
    if not np.any((hz >= (low or 0.0)) & (hz <= (high or np.inf))):
        key = "frf_from_hz" if low is not None else "frf_to_hz"
        raise FemtuneError(
            "response.no-lines/validation", where=study.file.where("validate", key), low=float(hz.min()),
            high=float(hz.max()),
        )  # fmt: skip


def _entries(study: Study) -> list[FrfResidualTable]:
    return [c.entry for c in study.file.comparisons if isinstance(c.entry, FrfResidualTable)]


def _unused(study: Study, case: StudyCase, x: Reals) -> UnusedFrfs:
    assert case.test is not None
    frfs = case.test.frfs
    if frfs is None:
        return UnusedFrfs(case, None, "its test has no FRFs")
    values = np.where(used_functions(study, case)[:, :, None], np.nan, frfs.values)
    if not np.isfinite(values).any():
        return UnusedFrfs(case, None, "the update used all FRFs of its test")
    left = replace(case, test=replace(case.test, frfs=replace(frfs, values=values)))
    table = table_of_measured(study, case)
    request = response_request(study, left, table)
    measured, request = request.measured, replace(request, decay=case.test.decay)
    if measured is None:
        return UnusedFrfs(case, None, "none of the FRFs that were not used has a place in the model")
    point = case.configured.at(x)

    @cache
    def modes() -> EigenSolution:
        with errors_at_grid(study.built):
            return study.solver.modes(point, *request.modes)

    for residual, test in () if case.used is None else identified_residuals(case.used.residuals):
        # the update had one damping ratio; measured FRFs are compared with the measured one of each mode
        ratios = measured_damping(residual, test, modes()).ratios
        request = replace(request, damping=damping_by_mode(ratios.tolist()))
    model, _ = solved_frfs(study, request, point, modes)
    lines = np.searchsorted(measured.freq_hz, request.freq_hz)
    labels = (request.outputs.labels.labels(), request.inputs.labels.labels())
    return UnusedFrfs(case, PredictedFrfs(*labels, request.freq_hz, model, measured.values[:, :, lines]))


def used_functions(study: Study, case: StudyCase) -> NDArray[np.bool_]:
    """(responses, references) True for the FRFs of a configuration's test that the update used."""
    assert case.test is not None
    frfs = case.test.frfs
    assert frfs is not None
    used = np.zeros(frfs.values.shape[:2], bool)
    if case.used is None:
        return used
    if any(RESONANCES in stage.residuals for stage in study.file.stage):
        used[:] = True
        used[tuple(np.array(sorted(case.held.functions), int).reshape(-1, 2).T)] = False
        return used
    for residual in case.used.residuals:
        settled = residual.settled if isinstance(residual, AtFirstState) else residual
        if isinstance(settled, FrfResidual):
            rows, _ = settled.measured.responses.align(frfs.responses)
            columns, _ = settled.measured.references.align(frfs.references)
            used[np.ix_(rows, columns)] |= np.isfinite(settled.measured.values).any(axis=2)
        elif isinstance(settled, AntiresonanceResidual):
            outputs, inputs = frfs.responses.labels(), frfs.references.labels()
            for zero in settled.zeros:
                used[outputs.index(str(zero.response)), inputs.index(str(zero.reference))] = True
    return used


def table_of_measured(study: Study, case: StudyCase) -> ResponseTable:
    """Kind of the test; way, damping and band of the FRF residual of the configuration, or of the first one."""
    assert case.test is not None
    assert case.test.frfs is not None
    entries = _entries(study)
    of_case = [e for e in entries if e.is_in(case.name, several=False, used=True)] or entries
    given = study.file.validation
    keys: dict[str, object] = {"kind": case.test.frfs.kind}
    if of_case:
        same = of_case[0]
        keys |= {key: getattr(same, key) for key in ("method", "residual_vectors", "ratio", "ratios")}
        bands = [e for e in of_case if e.around == "band"]
        if bands:
            keys["from_hz"] = min(e.from_hz for e in bands)
            highest = [e.to_hz for e in bands]
            keys["to_hz"] = None if None in highest else max(h for h in highest if h is not None)
    keys |= {key: hz for key, hz in (("from_hz", given.frf_from_hz), ("to_hz", given.frf_to_hz)) if hz is not None}
    return ResponseTable.model_validate(keys)


def predicted_frfs(one: UnusedFrfs, data: str) -> Iterable[PredictedFrf]:
    """The records of one configuration."""
    for match in () if one.found is None else one.found.matches:
        yield PredictedFrf(
            configuration=one.case.name,
            data=data,
            output=match.output,
            input=match.input,
            frac=match.frac,
            mean_db=match.mean_db,
            max_db=match.max_db,
            max_hz=match.max_hz,
        )


def predicted_resonances(one: UnusedFrfs) -> Iterable[PredictedResonance]:
    """The resonance peaks of one configuration."""
    for match in () if one.found is None else one.found.resonances:
        yield PredictedResonance(
            configuration=one.case.name, input=match.input, test_hz=match.test_hz, model_hz=match.model_hz
        )
