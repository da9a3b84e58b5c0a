"""Measured FRFs beside which a page draws those of the live model, and how these are damped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Literal, cast

import numpy as np

from femtune.errors import FemtuneError
from femtune.fem.structure import ALL_MODES
from femtune.model import ModalDamping
from femtune.model.live import LiveDamping
from femtune.model.response import TIMES_HIGHEST_LINE, Ports, frf
from femtune.residuals.frf.model_way import settled
from femtune.residuals.frf.residual import FrfResidual
from femtune.steps.correlate.criteria import of_frfs
from femtune.steps.validate.frf_validation import table_of_measured, used_functions
from femtune.study.response import response_request
from femtune.units import frf_unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from femtune.arrays import Complexes, Reals
    from femtune.modal import FrfSet
    from femtune.modal.kinds import FrfKind
    from femtune.model import EigenSolution, ModelPoint
    from femtune.model.live import LiveModel, LivePorts
    from femtune.residuals import CaseState
    from femtune.residuals.kinds import FrfForm
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study

MOST_INPUTS = 12
"""Inputs of the functions of a page: each needs a static response of its own."""
MOST_OUTPUTS = 24
"""Outputs whose static responses are put into the basis too; the functions of others are less accurate."""
MOST_VALUES = 40_000
"""Values of the functions of a configuration: with more of them every n-th line is shown, and χ² is not computed."""
_ZERO = 1e-6
"""Size of a function relative to the largest one below which it is zero by symmetry."""
_SAMPLES = 24
"""Places between the entries of a table of quality factors, whose ratios are no straight lines."""
_TOP = 3.0
"""A table of damping goes as far as this many times the highest line."""


@dataclass(frozen=True, eq=False)
class ComparedFunctions:
    """Measured FRFs of a configuration.

    Parameters
    ----------
    look : "equalised" where the test has equal damping, else "test"
    outputs, inputs : their labels
    test : (o, i, l), NaN where nothing is compared
    ports : on the free DOFs of the model
    damping : of the modes
    how : what that is, in words
    sd, shift : (o, i, l) of the residual; None where the page computes no χ² of these
    form : of the residual
    label : kind of the residual; "" where the update did not use the functions
    every : n of every n-th line that is taken
    """

    kind: FrfKind
    unit: str
    look: Literal["test", "equalised"]
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    freq_hz: Reals = field(repr=False)
    test: Complexes = field(repr=False)
    ports: Ports = field(repr=False)
    damping: LiveDamping
    how: str
    sd: Reals | None = field(default=None, repr=False)
    shift: Reals | None = field(default=None, repr=False)
    form: FrfForm = "log-complex"
    label: str = ""
    every: int = 1

    def modes(self, live: LiveModel) -> int:
        """Modes that are superposed: those up to twice the highest line at the updated point, at least those shown."""
        values = live.modes(live.at, count=live.order).eigenvalues
        top = 2.0 * np.pi * TIMES_HIGHEST_LINE * float(self.freq_hz[-1])
        return min(live.order, max(live.count, int((values <= top**2).sum()) + 2))

    def of_full(self, solution: EigenSolution) -> Complexes:
        """(o, i, l) of a solution of the full model."""
        found = frf(solution, self.ports, self.freq_hz, self.kind, "real-modes", damping=self.damping)
        return found.values

    def squares(self, values: Complexes) -> float:
        """Sum of squares of the residuals of functions (o, i, l)."""
        assert self.sd is not None
        at = np.isfinite(self.sd)
        test, model = self.test[at], values[at]
        errors = model - test if self.form == "linear" else np.log(model / test)
        real = errors.real + (self.shift[at] if self.shift is not None and self.form != "linear" else 0.0)
        imaginary = np.zeros(len(real)) if self.form == "log-magnitude" else errors.imag
        return float(np.sum((real**2 + imaginary**2) / self.sd[at] ** 2))


def function_percent(found: Complexes, other: Complexes) -> tuple[float, int]:
    """Largest difference of a function, root of the sum of squares over its lines relative to its own, in %, and the
    position of the function, outputs before inputs."""
    size = np.linalg.norm(other, axis=2)
    some = size > _ZERO * size.max(initial=0.0)
    if not some.any():
        return 0.0, 0
    relative = np.zeros(size.shape)
    relative[some] = np.linalg.norm(found - other, axis=2)[some] / size[some]
    worst = int(relative.argmax())
    return float(100.0 * relative.flat[worst]), worst


def live_values(ports: LivePorts, live: LiveModel, x: NDArray) -> Complexes | None:
    """(o, i, l); None where the model has no modes."""
    try:
        return ports.values(live, x)
    except (np.linalg.LinAlgError, FemtuneError):
        return None


def compared_functions(
    study: Study, case: StudyCase, state: CaseState, x: Reals
) -> tuple[tuple[ComparedFunctions, ...], str]:
    """The functions of a configuration, and why some or all are not computed again; "" where all are."""
    full = state.case.on_full_model
    residuals = [r for one in full.residuals if isinstance(r := settled(one), FrfResidual)]
    frfs = case.test.frfs if case.test is not None else None
    if not residuals and frfs is None:
        return (), ""
    point = full.configured.at(x)
    reason = _damping_of_elements(point)
    if reason:
        return (), reason
    try:
        found = list(_of_residuals(study, residuals, point) if residuals else _of_test(study, case, state, point))
        if residuals and of_frfs(study) and (left := _left(study, case)) is not None:
            found += _of_test(study, left, state, point)
    except FemtuneError as error:
        return (), error.what
    reasons = [one for one in found if isinstance(one, str)]
    return tuple(one for one in found if not isinstance(one, str)), "; ".join(dict.fromkeys(reasons))


def _left(study: Study, case: StudyCase) -> StudyCase | None:
    """The configuration with those functions alone that the update did not use; None without any."""
    if case.test is None or case.test.frfs is None:
        return None
    frfs = case.test.frfs
    values = np.where(used_functions(study, case)[:, :, None], np.nan, frfs.values)
    if not np.isfinite(values).any():
        return None
    return replace(case, test=replace(case.test, frfs=replace(frfs, values=values)))


def _damping_of_elements(point: ModelPoint) -> str:
    """Why the damping of a model is none of its modes; "" where it is."""
    if np.abs(point.viscous.data).max(initial=0.0) > 0.0:
        return "the model has dashpots"
    eta = point.loss_factor
    rest = point.hysteretic if eta is None else point.hysteretic - eta.value * point.stiffness
    if np.abs(rest.data).max(initial=0.0) > 1e-9 * max(np.abs(point.hysteretic.data).max(initial=0.0), 1e-300):
        return "single elements or materials have loss factors"
    if eta is not None and np.any(eta.grad != 0.0):
        return "the loss factor is a parameter"
    if any(np.any(ratio.grad != 0.0) for ratio in point.mode_ratios.values()):
        return "damping ratios are parameters"
    return ""


def _of_residuals(study: Study, residuals: list[FrfResidual], point: ModelPoint) -> Iterator[ComparedFunctions | str]:
    for residual in residuals:
        if residual.left_out is not None:
            yield "modes are left out of them"
            continue
        if residual.way.decay:
            yield "they have an exponential window"
            continue
        compared, of = np.isfinite(residual.sd), residual.measured
        damping = _of_modes(point, residual.way.damping, residual.highest_hz)
        if damping is None:
            yield "they are not damped, or not by the modes alone"
            continue
        whole = np.array_equal(residual.model_lines[0], np.unique(of.freq_hz)) and not any(
            c.size for c in residual.common
        )
        yield _chosen(
            study, of, np.where(compared, of.values, np.nan), residual.places.ports(point.configured, of), damping,
            "as in the update", "test" if residual.identified is None else "equalised",
            residual=residual if whole else None, label=residual.label,
        )  # fmt: skip


def _of_test(study: Study, case: StudyCase, state: CaseState, point: ModelPoint) -> Iterator[ComparedFunctions | str]:
    """Functions that the update did not compare."""
    table, stated = table_of_measured(study, case), study.file.response
    if stated is not None and table.ratio is None and table.ratios is None:
        table = table.model_copy(update={"ratio": stated.ratio, "ratios": stated.ratios})
    request = response_request(study, case, table)
    measured = request.measured
    if case.test is not None and case.test.exponential_s is not None:
        yield "they have an exponential window"
        return
    if measured is None:
        yield "none of the measured FRFs has a place in the model"
        return
    damping, how = _of_modes(point, request.damping, float(request.freq_hz[-1])), "of the study"
    if damping is None:
        damping, how = _of_pairs(case, state), "the measured damping of the paired modes, of others their median"
    if damping is None:
        yield "neither the study nor the modes of the test have damping"
        return
    lines = np.searchsorted(measured.freq_hz, request.freq_hz)
    yield _chosen(
        study, measured, measured.values[:, :, lines], request.ports, damping, how, "test", freq_hz=request.freq_hz
    )


def _chosen(
    study: Study, of: FrfSet, test: Complexes, ports: Ports, damping: LiveDamping, how: str,
    look: Literal["test", "equalised"], *, freq_hz: Reals | None = None, residual: FrfResidual | None = None,
    label: str = "",
) -> ComparedFunctions | str:  # fmt: skip
    """With as many lines as there is room for."""
    freq_hz = np.asarray(of.freq_hz if freq_hz is None else freq_hz, float)
    positive = freq_hz > 0.0
    if len(of.references) > MOST_INPUTS:
        return f"there are {len(of.references)} inputs; a page offers up to {MOST_INPUTS}"
    if test.shape[0] * test.shape[1] > MOST_VALUES // 8 or not positive.any():
        return f"there are {test.shape[0] * test.shape[1]:,} of them"
    every = -(-int(positive.sum()) * test.shape[0] * test.shape[1] // MOST_VALUES)
    taken = np.flatnonzero(positive)[::every]
    used = residual is not None and every == 1 and bool(positive.all())
    return ComparedFunctions(
        cast("FrfKind", of.kind), frf_unit(of.kind, study.file.study.unit_system),
        look, tuple(of.responses.labels()), tuple(of.references.labels()), freq_hz[taken], test[:, :, taken], ports,
        damping, how, residual.sd if residual is not None and used else None,
        residual.shift if residual is not None and used else None, residual.form if residual is not None else "linear",
        label, every,
    )  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# Damping.


def _of_modes(point: ModelPoint, damping: object, top_hz: float) -> LiveDamping | None:
    """Modal damping and the loss factor of a model; None where it has neither."""
    eta = 0.0 if point.loss_factor is None else float(np.real(point.loss_factor.value))
    own = {n: float(np.real(ratio.value)) for n, ratio in point.mode_ratios.items()}
    if damping is None and not own:
        return LiveDamping(np.zeros(1), loss_factor=eta) if eta else None
    stated = damping if isinstance(damping, ModalDamping) else None
    if damping is not None and stated is None:
        return None
    hysteretic = stated is not None and stated.hysteretic
    if own and stated is not None and ALL_MODES not in own:
        return None
    if own:
        every, last = own.get(ALL_MODES, 0.0), max(own)
        ratios = [own.get(n, every) for n in range(1, max(last, 0) + 1)]
        return LiveDamping(np.array([*ratios, every]), hysteretic=hysteretic, loss_factor=eta)
    assert stated is not None
    if stated.by_mode:
        return LiveDamping(stated.ratio(np.zeros(len(stated.values))), hysteretic=hysteretic, loss_factor=eta)
    if stated.freq_hz is None or len(stated.values) == 1:
        return LiveDamping(stated.ratio(np.zeros(1)), hysteretic=hysteretic, loss_factor=eta)
    places = _places(np.asarray(stated.freq_hz), _TOP * top_hz, stated.unit == "Q")
    return LiveDamping(stated.ratio(places), places, hysteretic, eta)


def _places(freq_hz: Reals, top_hz: float, curved: bool) -> Reals:
    """Frequencies between which a table is straight: its own, just before and after each, and both ends."""
    least = 1e-9 * float(freq_hz[-1])
    own = np.unique(np.concatenate([freq_hz - least, freq_hz + least, [0.0, max(top_hz, 2.0 * float(freq_hz[-1]))]]))
    own = own[own >= 0.0]
    return np.unique(np.concatenate([np.linspace(a, b, _SAMPLES) for a, b in pairwise(own)])) if curved else own


def _of_pairs(case: StudyCase, state: CaseState) -> LiveDamping | None:
    """The measured damping of the paired modes, and for other modes the median of it."""
    measured = state.case.test.damping_ratio
    if measured is None or not state.groups:
        return None
    known = {
        model: float(measured[test])
        for tests, models in state.groups for test, model in zip(tests, models) if measured[test] > 0.0
    }  # fmt: skip
    if not known:
        return None
    middle = float(np.median(list(known.values())))
    return LiveDamping(np.array([known.get(j, middle) for j in range(max(known) + 1)] + [middle]))
