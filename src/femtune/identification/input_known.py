"""From functions to modes and a state-space model in one step."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError, Notice, with_notices
from femtune.identification.beyond_band import system_beyond
from femtune.identification.choice import (
    CHOSEN_BY_USER,
    Candidate,
    Limits,
    PickedPole,
    Rule,
    change_choice,
    choose,
    chosen_poles,
    come_back,
    pick_poles,
    poles_of_order,
)
from femtune.identification.force_noise import with_force_noise
from femtune.identification.frf_checks import check_frfs, dead_responses
from femtune.identification.in_place import in_place
from femtune.identification.information import leaves_noise, with_needed_modes
from femtune.identification.join import FitQuality, complete_lines, fit_quality, in_band
from femtune.identification.kinds import KNOWN_INPUT
from femtune.identification.late_channels import late_notices
from femtune.identification.modal_fit import ModalFit, fit_modes
from femtune.identification.modal_solve import OutsideTerms, modal_basis, outside_terms
from femtune.identification.mode_checks import ModeRemark, quadrature_notices
from femtune.identification.n4sid import n4sid_poles, subspace
from femtune.identification.near_band import fit_with_neighbours
from femtune.identification.noise_law import noise_at_peaks, with_noise_by_magnitude
from femtune.identification.parts_of_record import with_parts_of_time
from femtune.identification.plscf import normal_equations, plscf_poles
from femtune.identification.pole_table import PoleTable, join_tables
from femtune.identification.rigid_body import with_rigid_body, without_rigid_body
from femtune.identification.shapes import (
    as_modes,
    driving_points,
    fit_remarks,
    leading_shapes,
    scaled_shapes,
    without_noise,
)
from femtune.identification.significance import without_poles_of_noise
from femtune.identification.state_space_fit import SystemFit
from femtune.identification.whole_record import WholeRecord, binned, coherence_of_fit
from femtune.identification.window import fit_with_window, with_window, without_window
from femtune.modal import FrfSet, ModeSet, StateSpace, freq_and_damping

FIXED_ORDER = "N4SID"
"""Method of a fixed order."""
ORDERS_A_MODE = 5.0
"""Largest order over the number of modes that come back in the largest orders. A mode is taken if it is stable in three
tenths of the orders; weak ones of many are so only from three and a half times the number of modes on."""
WORTH_RAISING = 1.2
"""Factor by which orders are raised at least: less shows no further modes."""
MOST_ORDER = 120
"""Largest order to which orders are raised."""
_LISTED = 8
"""Frequencies in a message."""
_GROWS = 3.0
"""Standard deviations by which a pole must grow without the window for the window to be doubted."""
_HARDLY_FALLS = 0.8
"""Value of a window at the end of the record from which it hardly has an effect: usual ones fall to a hundredth."""
_SAMPLES_PER_PERIOD = 10.24
"""Delays of channels are looked for in steps of a quarter of a sample, with 2.56 samples a period at the last line."""


@dataclass(frozen=True)
class InputKnown:
    """Settings of identification from functions.

    Parameters
    ----------
    band_hz : where modes are looked for; all lines where None
    largest_order : of N4SID, in steps of two; polynomials of pLSCF go to half of it
    raised : larger orders are used, up to `MOST_ORDER`, where modes come back in the largest ones only
    methods : out of KNOWN_INPUT
    limits, rule : of stable poles and of modes among them
    take, drop : frequencies in Hz of candidates that are accepted as modes, or rejected, regardless of the rule
    picked : poles that are the modes, in place of all that the rule chooses; none where empty
    rigid : mass-normalised rigid-body modes whose motion is taken away first and put back into the system
    low, high : residual modes below and above the band that the system gets; None: as many as the functions want
    reciprocal : whether the system is reciprocal
    real : real shapes
    exponential_s : time constant τ of an exponential window e^{−t/τ} with which the functions were made. They are those
        of the structure at s = iω + 1/τ; poles, modes and system are those without the window
    order : of N4SID; its poles in the band are the modes, without the rule that asks several orders. None: by the rule
    suspension_hz : modes below it are rigid-body motions on a suspension, which are fitted and not reported
    by_reciprocity : functions of more forces than responses, as a hammer that roves gives them, are identified as those
        of so many responses: H_ij = H_ji. The shapes are at the points of the forces then; functions, fits and system
        have the forces and responses that were measured
    """

    band_hz: tuple[float, float] | None = None
    largest_order: int = 60
    methods: tuple[str, ...] = KNOWN_INPUT
    limits: Limits = field(default_factory=Limits)
    rule: Rule = field(default_factory=Rule)
    take: tuple[float, ...] = ()
    drop: tuple[float, ...] = ()
    picked: tuple[PickedPole, ...] = ()
    rigid: ModeSet | None = None
    low: int | None = None
    high: int | None = None
    reciprocal: bool = False
    real: bool = True
    exponential_s: float | None = None
    suspension_hz: float = 0.0
    by_reciprocity: bool = True
    order: int | None = None
    raised: bool = False

    @property
    def decay(self) -> float:
        """1/τ of the exponential window in rad/s; 0 without one."""
        return 0.0 if self.exponential_s is None else 1.0 / self.exponential_s

    def __post_init__(self) -> None:
        unknown = set(self.methods) - set(KNOWN_INPUT)
        if unknown or not self.methods:
            method = ", ".join(sorted(unknown))
            raise FemtuneError("identify.method/for-functions", method=method, methods=", ".join(KNOWN_INPUT))
        if self.largest_order < 4:
            raise FemtuneError("identify.method/order", order=self.largest_order)
        if self.order is not None and (self.order < 2 or self.order % 2):
            raise FemtuneError("identify.method/fixed-order", order=self.order)


@dataclass(frozen=True, eq=False)
class IdentifiedModes:
    """Result of an identification from functions.

    Parameters
    ----------
    modes : with standard deviations, covariance and, where a driving point was measured, modal scale
    system : state-space model of the modes and residual modes
    table, candidates : every pole of every order and method, and their clusters with choice and reason
    fit : the modal model
    system_fit : the fit of the system, without the rigid-body modes that were taken away first
    quality : of the system, function by function
    measured : the functions that were used
    notices : what a user should know
    remarks : those of the notices that belong to one mode
    clusters : of each mode, the position of its candidate
    roving : whether the shapes are at the references, where the force was, and not at the responses
    """

    modes: ModeSet
    system: StateSpace
    table: PoleTable
    candidates: tuple[Candidate, ...]
    fit: ModalFit
    system_fit: SystemFit
    quality: FitQuality
    measured: FrfSet
    notices: tuple[Notice, ...]
    remarks: tuple[ModeRemark, ...] = ()
    clusters: tuple[int, ...] = ()
    roving: bool = False

    @property
    def fit_of_shapes(self) -> ModalFit:
        """The modal model whose responses are the points of the shapes: that of `fit`, or its transpose."""
        return self.fit.transposed() if self.roving else self.fit

    def as_measured(self) -> IdentifiedModes:
        """Everything but the shapes with responses and references exchanged."""
        return replace(
            self,
            system=self.system.transposed(),
            fit=self.fit.transposed(),
            system_fit=self.system_fit.transposed(),
            quality=self.quality.transposed(),
            measured=self.measured.transposed(),
            roving=not self.roving,
        )


class NoModesChosen(FemtuneError):  # noqa: N818
    """``identify.no-poles``, with the poles and clusters from which a person may choose, and the functions."""

    def __init__(
        self, code: str, table: PoleTable, candidates: tuple[Candidate, ...], measured: FrfSet, **facts: Any
    ) -> None:
        super().__init__(code, **facts)
        self.table, self.candidates, self.measured = table, candidates, measured


def identify_frfs(
    frfs: FrfSet, asked: InputKnown, sd: NDArray[np.float64] | None = None, whole: WholeRecord | None = None
) -> IdentifiedModes:
    """Poles of all orders by every method, modes among them, their fit, and the system.

    Parameters
    ----------
    sd : (n, u, k) standard deviations of the functions, as an estimate of functions gives them, or None
    whole : the record whose functions these are; its lines are fitted at the end, in place of the functions

    Returns
    -------
    functions, fits and system have the responses and references of `frfs`, also where the shapes are at the references

    Raises
    ------
    FemtuneError : ``identify.no-poles`` where no cluster is a mode, ``identify.few-lines``, ``identify.band``,
        ``identify.suspension``, ``identify.missing-pair``, ``identify.missing-lines``, ``identify.no-candidate``,
        ``identify.rigid-modes``, ``identify.no-driving-point``
    """
    told = [*check_frfs(frfs), *_weak_window(frfs, asked.decay)]
    roving = asked.by_reciprocity and len(frfs.references) > len(frfs.responses)
    used = _without_dead(frfs)
    if roving:
        n_forces, n_responses = len(frfs.references), len(frfs.responses)
        told.append(Notice("identify.reciprocity", level="info", n_forces=n_forces, n_responses=n_responses))
        used, sd = used.transposed(), None if sd is None else np.swapaxes(sd, 0, 1)
    with with_notices(told):
        try:
            identified = _identified(used, asked, sd, whole)
        except NoModesChosen as error:
            error.measured = error.measured.transposed() if roving else error.measured
            raise
    identified = identified.as_measured() if roving else identified
    return replace(identified, notices=(*told, *identified.notices))


def _without_dead(frfs: FrfSet) -> FrfSet:
    """With zeros for dead responses: methods that scale each response to the same size would fit their noise."""
    return replace(frfs, values=np.where(dead_responses(frfs)[:, None, None], 0.0, frfs.values))


def _identified(
    frfs: FrfSet, asked: InputKnown, sd: NDArray[np.float64] | None, of_record: WholeRecord | None
) -> IdentifiedModes:
    whole, errors = _used(frfs, asked, sd)
    shift = asked.decay
    elastic = whole if asked.rigid is None else without_rigid_body(whole, asked.rigid, shift)
    motion, elastic = elastic, without_window(elastic, shift)
    band = asked.band_hz or (float(whole.freq_hz[0]), float(whole.freq_hz[-1]))
    table, candidates = _candidates(elastic, asked, errors, band)
    by_hand = [c.reason == CHOSEN_BY_USER for c in candidates]
    chosen = np.flatnonzero([c.chosen for c in candidates])
    if not len(chosen):
        raise NoModesChosen("identify.no-poles", _moved_table(table, shift), candidates, whole)
    low_order = () if of_record is not None or asked.picked or asked.order else _low_order(candidates, table)
    start, terms = chosen_poles(candidates, table).poles, outside_terms(shift)
    lines = of_record if of_record is None or asked.band_hz is None else of_record.inside(*band)
    fitted, known = (elastic, errors) if lines is None else (lines.frfs, None)

    def refit(inside: Complexes, outside: Complexes, below: float) -> ModalFit:
        return fit_modes(fitted, inside, known, terms, neighbours=outside, whole=lines, below=below)

    def search(inside: Complexes) -> ModalFit:
        found = fit_with_neighbours(fitted, inside, known, terms, lines)
        return found if lines is not None or known is not None else with_noise_by_magnitude(found, inside, terms)

    fit = search(start)
    # functions that were made elsewhere have errors that are no noise: frequencies that change between hits, windows
    if lines is not None and not asked.picked:
        fit, candidates = with_needed_modes(fit, candidates, table, refit, lines.line, search)
        chosen = np.flatnonzero([c.chosen for c in candidates])
        by_hand = [c.reason == CHOSEN_BY_USER for c in candidates]
    white = None if lines is None else leaves_noise(fit, lines.line)
    if lines is not None:
        fit = with_parts_of_time(with_force_noise(fit, lines, terms), lines, terms) if fit.converged else fit
        fit = _beside_functions(fit, elastic, lines, terms)
        # those without the decays that the ends of the record cut off, and without its other transients
        motion = fit.measured if lines.width and asked.rigid is None else motion
    of_system = _system(motion, fit, band, asked)
    if shift:
        fit, of_system = replace(fit, poles=fit.poles + shift), fit_with_window(of_system, -shift)
        table = _moved_table(table, shift)
        candidates = tuple(_moved(one, table) for one in candidates)
    try:
        fit, candidates, left, kept = in_place(fit, candidates, by_hand, table, band, asked.suspension_hz)
    except FemtuneError as error:
        raise NoModesChosen("identify.no-poles/left", table, candidates, whole, **error.facts) from error
    system = of_system.system if asked.rigid is None else with_rigid_body(of_system.system, asked.rigid)
    clusters = tuple(chosen[fit.begun_at[fit.reported]].tolist())
    used = whole if of_record is None else fit.measured
    told = (*low_order, *_growing(fit, shift))
    quality = fit_quality(with_window(system, shift).frf(used.freq_hz), used)
    remarks = (*kept, *fit_remarks(fit, scaled_shapes(fit, driving_points(elastic)), white))
    shapes, labels = leading_shapes(fit), whole.responses.labels()
    step_s = 1.0 / (_SAMPLES_PER_PERIOD * float(whole.freq_hz[-1]))
    late = late_notices(shapes, freq_and_damping(fit.poles[fit.reported])[0], labels, step_s, counted=False)
    phases = late or quadrature_notices(shapes, labels)
    notices = (*left, *told, *phases, *(r.notice for r in remarks), *_ends(fit, of_system, candidates, errors))
    return IdentifiedModes(
        modes=as_modes(fit, asked.real, tuple(candidates[i].name or str(r + 1) for r, i in enumerate(clusters))),
        system=system,
        table=table,
        candidates=candidates,
        fit=fit,
        system_fit=of_system,
        quality=quality,
        measured=used,
        notices=notices,
        remarks=remarks,
        clusters=clusters,
    )


def _candidates(
    elastic: FrfSet, asked: InputKnown, errors: NDArray[np.float64] | None, band: tuple[float, float]
) -> tuple[PoleTable, tuple[Candidate, ...]]:
    """All poles of all methods and orders, and their clusters with the choice of modes among them."""
    if asked.suspension_hz >= band[1]:
        raise FemtuneError("identify.suspension", suspension_hz=asked.suspension_hz, high_hz=band[1])
    largest, methods = asked.largest_order, asked.methods
    if asked.order is not None:
        largest, methods = max(largest, asked.order), tuple(dict.fromkeys((FIXED_ORDER, *methods)))
    limits = replace(asked.limits, band_hz=band)
    table, candidates = _to_order(elastic, methods, largest, limits, asked.rule, errors)
    while asked.raised and asked.order is None and (wanted := _wanted_order(candidates, table)):
        try:
            more = _to_order(elastic, methods, wanted, limits, asked.rule, errors)
        except FemtuneError as error:
            if error.code != "identify.few-lines":
                raise
            break
        table, candidates = more
    if asked.order is not None:
        candidates = poles_of_order(candidates, table, FIXED_ORDER, asked.order, limits)
    candidates = change_choice(candidates, asked.take, asked.drop)
    if asked.picked:
        candidates = pick_poles(candidates, _moved_table(table, asked.decay), asked.picked)
    return table, candidates


def _to_order(
    elastic: FrfSet, methods: tuple[str, ...], largest: int, limits: Limits, rule: Rule, errors: Reals | None
) -> tuple[PoleTable, tuple[Candidate, ...]]:
    """All poles up to an order, and their clusters as the rule chooses."""
    table = join_tables([_poles(elastic, method, largest, errors) for method in methods])
    candidates = choose(table, limits, rule)
    return table, without_poles_of_noise(candidates, table, elastic, 0.5 * rule.share)


def _wanted_order(candidates: tuple[Candidate, ...], table: PoleTable) -> int:
    """The largest order at which all modes that come back in the largest orders can be told; 0 if that is reached."""
    back = come_back(candidates, table)
    wanted = min(2 * round(0.5 * ORDERS_A_MODE * len(back)), MOST_ORDER)
    return 0 if all(c.chosen for c in back) or wanted < WORTH_RAISING * largest_order_of(table) else wanted


def largest_order_of(table: PoleTable) -> int:
    """The largest order in states; polynomials of pLSCF go to half of it."""
    of_n4sid = [order for method, order in zip(table.method, table.order) if method == FIXED_ORDER]
    return int(max(of_n4sid)) if of_n4sid else 2 * int(max(table.order, default=0))


def _low_order(candidates: tuple[Candidate, ...], table: PoleTable) -> tuple[Notice, ...]:
    """A warning of modes that come back in the largest orders and are not taken, where larger orders would tell."""
    wanted = _wanted_order(candidates, table)
    if not wanted:
        return ()
    back = come_back(candidates, table)
    names = [f"{c.freq_hz:.4g} Hz" for c in back if not c.chosen]
    listed = ", ".join(names[:_LISTED]) + (f" and {len(names) - _LISTED} more" if len(names) > _LISTED else "")
    return (
        Notice("identify.low-order", largest=largest_order_of(table), count=len(back), names=listed, wanted=wanted),
    )


def _beside_functions(fit: ModalFit, frfs: FrfSet, whole: WholeRecord, terms: OutsideTerms) -> ModalFit:
    """The fit to all lines of a record, shown beside its functions.

    Means over lines would blur sharp peaks, and a response that the end of the record cuts off has other functions.
    The functions are shown as the model with the mean of what it leaves, and with the coherence that this gives.
    """
    bins = bool(whole.width) and fit.ends is not None
    frfs = binned(whole)[0] if bins else frfs
    columns = modal_basis(frfs.freq_hz, fit.poles, frfs.kind, terms).columns
    residues = fit.residues[:, 0]
    model = (np.hstack([residues.real, residues.imag, fit.terms[:, 0]]) @ columns.T)[:, None]
    synthesised = replace(fit.synthesised, freq_hz=frfs.freq_hz, values=model)
    if bins and fit.ends is not None:
        rest = whole.without(fit.ends + fit.synthesised.values[:, 0])
        coherence = coherence_of_fit(whole, fit.synthesised.values[:, 0], rest.frfs.values[:, 0])
        frfs = replace(frfs, values=model + binned(rest)[0].values, coherence=coherence[:, None])
    return replace(fit, measured=frfs, synthesised=synthesised)


def _weak_window(frfs: FrfSet, decay: float) -> tuple[Notice, ...]:
    """A warning of a window that hardly falls in a record of 1/Δf seconds, as with a time constant in ms."""
    if not decay or len(frfs.freq_hz) < 2:
        return ()
    seconds = 1.0 / float(np.median(np.diff(frfs.freq_hz)))
    end = float(np.exp(-decay * seconds))
    if end < _HARDLY_FALLS:
        return ()
    return (Notice("identify.window-weak", seconds=1.0 / decay, block=seconds, end=100.0 * end),)


def _growing(fit: ModalFit, shift: float) -> tuple[Notice, ...]:
    """A warning of modes that grow where the damping of the window has been taken away, by more than chance."""
    if not shift:
        return ()
    sd = np.sqrt(np.maximum(np.diag(fit.pole_covariance)[: len(fit.poles)], 0.0))
    grow = fit.reported & (fit.poles.real > _GROWS * sd)
    if not grow.any():
        return ()
    hertz = ", ".join(f"{f:.4g} Hz" for f in freq_and_damping(fit.poles[grow])[0][:5])
    decays = shift - fit.poles.real[fit.reported]
    return (
        Notice(
            "identify.window-too-strong", count=int(grow.sum()), modes=int(fit.reported.sum()), names=hertz,
            seconds=1.0 / shift, least=1.0 / float(decays.min()),
        ),
    )  # fmt: skip


def _moved_table(table: PoleTable, shift: float) -> PoleTable:
    return replace(table, poles=table.poles + shift)


def _moved(one: Candidate, table: PoleTable) -> Candidate:
    """A cluster with the medians of its poles, which have been moved."""
    of = table.select(one.members)
    return replace(one, freq_hz=float(np.median(of.freq_hz)), damping_ratio=float(np.median(of.damping_ratio)))


def _used(frfs: FrfSet, asked: InputKnown, sd: NDArray[np.float64] | None) -> tuple[FrfSet, NDArray[np.float64] | None]:
    used = complete_lines(frfs if asked.band_hz is None else in_band(frfs, *asked.band_hz))
    if sd is None:
        return used, None
    kept = sd[:, :, np.isin(frfs.freq_hz, used.freq_hz)]
    return used, kept if np.isfinite(kept).all() and (kept > 0.0).all() else None


def _poles(frfs: FrfSet, method: str, order: int, sd: NDArray[np.float64] | None) -> PoleTable:
    if method == "N4SID":
        return n4sid_poles(subspace(frfs, order, sd=sd), range(2, order + 1, 2))
    return plscf_poles(normal_equations(frfs, order // 2, sd), range(2, order // 2 + 1))


def _system(elastic: FrfSet, fit: ModalFit, band: tuple[float, float], asked: InputKnown) -> SystemFit:
    return system_beyond(
        elastic, fit.poles, band, asked.low, asked.high, reciprocal=asked.reciprocal, decay=asked.decay
    )


def _ends(
    fit: ModalFit, system: SystemFit, candidates: tuple[Candidate, ...], stated: Reals | None
) -> tuple[Notice, ...]:
    """What the noise is, how the iterations ended, and candidates that came near to being modes."""
    remarks = [Notice("identify.no-noise")] if without_noise(fit) else []
    if fit.line_sd is not None and stated is None:
        part, floor = noise_at_peaks(fit)
        remarks.append(Notice("identify.noise-by-magnitude", level="info", percent=100.0 * part, floor=100.0 * floor))
    if not fit.converged:
        remarks.append(Notice("identify.not-converged", n_poles=len(fit.poles), steps=fit.steps))
    if fit.outside.any():
        freq = freq_and_damping(fit.poles[fit.outside])[0]
        names = " and ".join(f"{f:.4g} Hz" for f in freq)
        remarks.append(Notice("identify.near-band", level="info", count=len(freq), frequencies=names))
    if not system.converged:
        remarks.append(Notice("identify.system-not-converged", steps=system.steps, gradient=system.gradient))
    near = [c for c in candidates if not c.chosen and max(c.share.values()) >= 0.25 and "same mode" not in c.reason]
    if near:
        names = ", ".join(f"{c.freq_hz:.4g} Hz ({c.reason})" for c in near[:5])
        remarks.append(Notice("identify.near-miss", level="info", names=names))
    return tuple(remarks)
