"""Error of superposed FRFs, from direct solutions with the dynamic stiffness at a few lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from femtune.arrays import Complexes, Integers, Reals
from femtune.modal.frf_set import KINDS
from femtune.model import EigenSolution
from femtune.model.eigen.pencil import Pencil
from femtune.model.eigen.sturm import count_below
from femtune.model.kinds import FrfMethod
from femtune.model.response import TIMES_HIGHEST_LINE
from femtune.residuals.case import CaseState, Residual
from femtune.residuals.frf.model_way import full_modes, settled
from femtune.residuals.frf.residual import FrfResidual, frf_comparison

SMALL = 0.1
"""Error of superposed FRFs in standard deviations of the measured ones up to which it is small."""
FURTHER_TIMES = (3.0, 4.0)
"""Frequency up to which modes are superposed, over the highest line, if `TIMES_HIGHEST_LINE` leaves a larger error."""
MOST_DOFS = 30_000
"""Free DOFs up to which the error is computed; direct solutions of larger models would take as long as the update."""
_COMPARED_LINES = 4
"""Evenly spaced lines at which all functions are also solved directly; each costs a factorisation."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Truncation:
    """Superposed FRFs of a residual compared with solutions of (K + iωC − ω²M)u = f at a few of its lines.

    Parameters
    ----------
    configuration : name
    method : how the functions are computed
    modes, reach_hz : number of modes that are superposed, and the frequency of the last one; None without modes
    limit : the key that limits the number of modes; ""
    highest_hz : highest line of the residual
    missing : number of further modes up to twice the highest line; None if not known
    lines_hz : (n,) lines at which they were compared; none for the direct method, which has no truncation
    largest, mean : largest and root mean square error of the residuals, in standard deviations
    relative : largest |H/H_direct − 1|
    function, line_hz : where `largest` is
    vectors : whether residual vectors are added to the modes
    order : of the reduced model that they are of; None for superposed modes of the full model
    large : DOFs of a full model that is too large for direct solutions; None if they were made
    """

    configuration: str
    method: FrfMethod
    modes: int | None
    reach_hz: float | None
    limit: str
    highest_hz: float
    missing: int | None = None
    lines_hz: Reals = field(default_factory=lambda: np.zeros(0))
    largest: float = 0.0
    mean: float = 0.0
    relative: float = 0.0
    function: str = ""
    line_hz: float = 0.0
    vectors: bool = True
    order: int | None = None
    large: int | None = None

    @property
    def small(self) -> bool:
        """True if the error is small beside the standard deviations of the measured functions."""
        return self.largest <= SMALL

    @property
    def lacks(self) -> str:
        """The modes that are missing, in words."""
        if self.order is not None:
            return f"vectors that a reduced model of order {self.order} lacks"
        if self.modes is None or self.reach_hz is None:
            return "no modes"
        wanted = TIMES_HIGHEST_LINE * self.highest_hz
        if self.missing:
            first, last = self.modes + 1, self.modes + self.missing
            which = f"mode {first}" if self.missing == 1 else f"modes {first} to {last}"
            which = f"{which}, between {self.reach_hz:.4g} and {wanted:.4g} Hz"
        else:
            which = f"the modes above {max(self.reach_hz, wanted):.4g} Hz"
        return which if self.vectors else f"{which}, and residual vectors (residual_vectors = false)"


def with_enough_modes(residual: FrfResidual, state: CaseState) -> tuple[FrfResidual, float]:
    """The residual with further modes where its error is not small, and how many times the highest line they reach.

    Small errors of single values can move parameters by as much as their standard deviations, because they have the
    same sign along whole bands. A number of modes that the study states is kept, and so are the modes of large models.
    """
    way, times = residual.way, TIMES_HIGHEST_LINE
    superposed = way.method != "direct" and way.residual_vectors and way.modes is not None
    if way.limit or not superposed or state.full.configured.n_free > MOST_DOFS or residual.known(state) is not None:
        return residual, times
    error = truncation(residual, state).largest
    for further in FURTHER_TIMES:
        if error <= SMALL:
            break
        number = full_modes(state, (None, further * residual.highest_hz)).wanted
        other = replace(residual, way=replace(way, modes=(number, None)))
        left = truncation(other, state).largest
        if left < error:
            residual, error, times = other, left, further
    return residual, times


def truncations(state: CaseState) -> Iterator[Truncation]:
    """Errors of all FRF residuals of a case, at a state at which the residuals were evaluated."""
    for residual in frf_residuals(state.case.residuals):
        yield truncation(residual, state)


def frf_residuals(residuals: Sequence[Residual]) -> Iterator[FrfResidual]:
    """The FRF residuals of a case; those that are settled at the first state are included only afterwards."""
    for residual in residuals:
        with_modes = settled(residual)
        if isinstance(with_modes, FrfResidual):
            yield with_modes


def truncation(residual: FrfResidual, state: CaseState) -> Truncation:
    """The error of a residual's functions at a state; errors as of the residual, and of the direct solution."""
    way, top = residual.way, residual.highest_hz
    model = way.model(state, top)
    solved = model if isinstance(model, EigenSolution) else None
    reduced = residual.known(state)
    summary = Truncation(
        configuration=residual.configuration,
        method=way.method,
        modes=None if solved is None else solved.wanted,
        reach_hz=None if solved is None else float(solved.freq_hz[-1]),
        limit=way.limit,
        highest_hz=top,
    )
    if way.method == "direct" and reduced is None:
        return summary
    summary = replace(summary, vectors=way.residual_vectors, order=None if reduced is None else reduced.order)
    if reduced is not None and (large := state.full.configured.n_free) > MOST_DOFS:
        return replace(summary, large=large)
    values = residual.functions(model)[0] if reduced is None else reduced.values
    at = _lines(residual, np.abs(values))
    few, values = _at_lines(residual, at), values[:, :, at]
    exact = replace(few, way=replace(way, method="direct")).functions(model)[0]
    known = np.isfinite(few.sd)
    differences, _ = frf_comparison(residual.form).compare(
        values[known], np.zeros((int(known.sum()), 0), complex), exact[known]
    )
    errors = np.abs(differences.reshape(-1, int(known.sum()))).max(axis=0) / few.sd[known]
    i, j, k = (int(axis[errors.argmax()]) for axis in np.nonzero(known))
    return replace(
        summary,
        missing=None if reduced is not None or solved is None else _missing(solved, top),
        lines_hz=few.measured.freq_hz,
        largest=float(errors.max()),
        mean=float(np.sqrt(np.mean(errors**2))),
        relative=_relative(values[known], exact[known]),
        function=f"{few.measured.responses[i]} / {few.measured.references[j]}",
        line_hz=float(few.measured.freq_hz[k]),
    )


def _relative(values: Complexes, exact: Complexes) -> float:
    """Largest |H/H_direct − 1|, of functions that are not zero."""
    some = exact != 0.0
    return float(np.abs(values[some] / exact[some] - 1.0).max(initial=0.0))


def _lines(residual: FrfResidual, size: Reals) -> Integers:
    """Positions of evenly spaced lines, the last among them, and the one where the least error counts."""
    known = np.isfinite(residual.sd)
    lines = np.flatnonzero(known.any(axis=(0, 1)))
    even = lines[np.unique(np.linspace(0, len(lines) - 1, _COMPARED_LINES).round().astype(int))]
    # modes far above the lines add a static displacement
    unit = np.abs(residual.measured.freq_hz) ** KINDS.index(residual.measured.kind)
    allowed = np.where(known, residual.sd * (1.0 if residual.form == "linear" else size) / unit, np.inf)
    return np.unique([*even, int(allowed.min(axis=(0, 1)).argmin())])


def _at_lines(residual: FrfResidual, at: Integers) -> FrfResidual:
    """The residual at some of its lines."""
    measured = residual.measured
    regions = (replace(r, at=np.flatnonzero(np.isin(at, r.at))) for r in residual.regions)
    return replace(
        residual,
        measured=replace(measured, freq_hz=measured.freq_hz[at], values=measured.values[:, :, at], coherence=None),
        sd=residual.sd[:, :, at],
        regions=tuple(r for r in regions if r.at.size),
        shift=None,
        noise=None,
        common=(),
    )


def _missing(modes: EigenSolution, highest_hz: float) -> int | None:
    """Number of modes up to twice the highest line that are not superposed."""
    wanted = TIMES_HIGHEST_LINE * highest_hz
    if modes.freq_hz[-1] >= wanted:
        return 0
    pencil = Pencil(modes.point.symmetric_stiffness, modes.point.symmetric_mass)
    below = count_below(pencil, (2.0 * np.pi * wanted) ** 2).below
    return None if below is None else max(0, below - modes.wanted)
