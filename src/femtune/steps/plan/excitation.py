"""Exciters of a plan, how they excite the target modes, and the frequency lines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.dofs import DIRECTIONS, Dof, parse_dof
from femtune.errors import FemtuneError, Where
from femtune.files.study_file.kinds import number_list
from femtune.planning import calibration_lines, driving_point_levels, mode_indicator, place_exciters, record_length
from femtune.planning.lines_for_poles import PoleLines
from femtune.steps.modes.shapes import grid_translations
from femtune.steps.plan.record import LinesForPoles, ModeExcitation, PlannedExciter, PlannedLines, PlannedPoleLines
from femtune.study.error_places import errors_at

if TYPE_CHECKING:
    from femtune.files.study_file import PlanTable
    from femtune.model import EigenSolution
    from femtune.steps.plan.candidates import Sites, Uniaxial
    from femtune.steps.plan.record import PlannedSensor
    from femtune.study.record import Vector3
    from femtune.study.study import Study

_BAND_MARGIN = 0.1
"""Fraction of the frequency by which the lines extend beyond the target modes if no band is given.

The flanks of the lowest and highest resonances also carry information.
"""


@dataclass(frozen=True, eq=False)
class Exciter:
    """A force at a grid point: its row, local axes (3, 3), axis from 0, and the target modes (m,) along it."""

    row: int
    axes: Reals
    axis: int
    shape: Reals
    given: bool = False

    @property
    def direction(self) -> Reals:
        """(3,) in the basic system."""
        return np.asarray(self.axes[self.axis])


Choose = Callable[[Integers, Sequence[Exciter]], Integers]


@dataclass(frozen=True, eq=False)
class Excitation:
    """Exciters with the level (e, m) of each target mode."""

    exciters: tuple[Exciter, ...]
    levels: Reals


def find_exciters(
    study: Study, solution: EigenSolution, targets: Integers, table: PlanTable, sites: Sites, uniaxial: Uniaxial,
    choose: Choose | None = None,
) -> Excitation:  # fmt: skip
    """Given exciters, and those that are placed.

    Parameters
    ----------
    choose : positions of the chosen ones among candidates, of which it gets the positions in `uniaxial`, beside given
        exciters; by the levels of the target modes where None

    Raises
    ------
    FemtuneError : ``plan.exciters``, ``model.unknown-node``
    """
    shapes = sites.local[uniaxial.site, uniaxial.axis]
    given = _given(study, solution, targets, table)
    own = np.array([e.shape for e in given]).reshape(-1, len(targets))
    # levels of given and placed exciters refer to the same best point
    whole = driving_point_levels(np.concatenate([shapes, own]))
    some = _allowed(study, table, sites, uniaxial)
    if table.exciters > len(some):
        raise FemtuneError(
            "plan.exciters", where=study.file.where("plan", "exciters"), wanted=table.exciters, candidates=len(some)
        )
    chosen = some[:0]
    if table.exciters:
        if choose is None:
            chosen = some[place_exciters(whole[some], table.exciters, whole[len(shapes) :])]
        else:
            chosen = some[choose(some, given)]
    placed = [
        Exciter(int(sites.rows[i]), sites.axes[i], int(a), shapes[k])
        for k, i, a in zip(chosen, uniaxial.site[chosen], uniaxial.axis[chosen])
    ]
    return Excitation((*given, *placed), np.concatenate([whole[len(shapes) :], whole[chosen]]))


def _allowed(study: Study, table: PlanTable, sites: Sites, uniaxial: Uniaxial) -> Integers:
    every = np.arange(len(uniaxial.site))
    if table.exciter_nodes is None:
        return every
    nodes, wanted = study.model.structure.nodes, number_list(table.exciter_nodes)
    where = study.file.where("plan", "exciter_nodes")
    with errors_at(where):
        for node in wanted.singles:
            nodes.position(node)
    some = every[np.isin(nodes.ids[sites.rows[uniaxial.site]], wanted.among(nodes.ids.tolist()))]
    if not some.size and table.exciters:
        raise FemtuneError("plan.exciters/no-candidate", where=where)
    return some


def _given(study: Study, solution: EigenSolution, targets: Integers, table: PlanTable) -> list[Exciter]:
    nodes, exciters = study.model.structure.nodes, []
    motion = solution.point.configured
    for i, text in enumerate(table.exciters_placed):
        dof, where = parse_dof(text), study.file.where("plan", "exciters_placed", i)
        if not 1 <= dof.component <= 3:
            raise FemtuneError("plan.exciters/rotation", where=where, dof=text)
        with errors_at(where):
            row = nodes.position(dof.node)
        axes = nodes.frames[row].T.copy()
        axes[dof.component - 1] *= dof.sign
        translations = grid_translations(motion, solution, np.array([row]))[0]
        shape = axes[dof.component - 1] @ translations
        if not np.abs(shape[targets]).max(initial=0.0) > 0.0:
            raise FemtuneError("plan.exciters/still", where=where, dof=text)
        exciters.append(Exciter(row, axes, dof.component - 1, shape[targets], given=True))
    return exciters


def exciter_records(
    study: Study, excitation: Excitation, sensors: tuple[PlannedSensor, ...]
) -> tuple[PlannedExciter, ...]:
    """The exciters as records."""
    ids, xyz = study.model.structure.nodes.ids, study.model.structure.nodes.xyz
    records = []
    for k, e in enumerate(excitation.exciters):
        node = int(ids[e.row])
        records.append(
            PlannedExciter(
                name=f"E{k + 1}",
                node=node,
                dof=str(Dof(node, DIRECTIONS[e.axis + 1])),
                position=_vector(xyz[e.row]),
                axes=(_vector(e.axes[0]), _vector(e.axes[1]), _vector(e.axes[2])),
                direction=_vector(e.direction),
                given=e.given,
                sensor=_sensor_at(node, e.direction, sensors),
            )
        )
    return tuple(records)


def _sensor_at(node: int, direction: Reals, sensors: tuple[PlannedSensor, ...]) -> str | None:
    """A sensor at the driving point along the force."""
    for s in sensors:
        if s.node == node and (s.direction is None or abs(np.dot(s.direction, direction)) > 0.99):
            return s.name
    return None


def mode_excitation(
    solution: EigenSolution,
    targets: Integers,
    excitation: Excitation,
    outputs: Reals,
    inputs: Reals,
    damping_ratio: float,
) -> tuple[ModeExcitation, ...]:
    """Level and mode indicator of each target mode.

    Parameters
    ----------
    outputs, inputs : (o, n) and (i, n) all wanted modes at the sensors and exciters
    """
    values = np.where(solution.eigenvalues > 0.0, solution.eigenvalues, 0.0)[: solution.wanted]
    hz = solution.freq_hz[targets]
    # a rigid-body mode has no resonance
    indicator = mode_indicator(np.maximum(hz, 1e-3 * hz.max(initial=1.0)), values, damping_ratio, outputs, inputs)
    best = excitation.levels.argmax(axis=0)
    return tuple(
        ModeExcitation(
            number=int(t) + 1,
            exciter=f"E{best[j] + 1}",
            level=float(excitation.levels[best[j], j]),
            indicator=indicator[j],
        )
        for j, t in enumerate(targets)
    )


def frequency_lines(table: PlanTable, elastic_hz: Reals, arrays: dict[str, Reals], where: Where) -> PlannedLines | None:
    """Lines over the band, or from a tenth below to a tenth above the elastic target modes.

    Parameters
    ----------
    where : of the damping ratio, for the error ``plan.too-many-lines``
    """
    if not len(elastic_hz):
        return None
    low, high = (1.0 - _BAND_MARGIN) * elastic_hz.min(), (1.0 + _BAND_MARGIN) * elastic_hz.max()
    if table.band_hz is not None and table.band_hz[0] > 0.0:
        low, high = table.band_hz
    ratio, per = table.damping_ratio, table.lines_per_half_band
    with errors_at(where):
        lines = calibration_lines(low, high, ratio, per)
    arrays["plan/calibration_lines"] = lines
    record = record_length(low, high, float(elastic_hz.min()), ratio, per)
    return PlannedLines(
        low_hz=float(low), high_hz=float(high), damping_ratio=ratio, per_half_band=per, calibration_lines=len(lines),
        calibration_key="plan/calibration_lines", spacing_hz=record.spacing_hz, duration_s=record.duration_s,
        decay_s=record.decay_s, identification_lines=record.lines,
    )  # fmt: skip


def pole_lines_record(
    found: Sequence[PoleLines], relative: float, floor: float, arrays: dict[str, Reals]
) -> PlannedPoleLines:
    """Lines for an identification as a record; their frequencies go into `arrays`."""
    out = []
    for one in found:
        key = f"plan/identification_lines/{one.spacing.replace(' ', '_')}"
        arrays[key] = one.lines_hz
        known = bool(np.isfinite(one.relative_sd).all())
        out.append(
            LinesForPoles(
                spacing=one.spacing,
                rms_percent=100.0 * one.root_mean_square if known else None,
                largest_percent=100.0 * float(one.relative_sd.max()) if known else None,
                lines_key=key,
            )
        )
    return PlannedPoleLines(lines=len(found[0].lines_hz), relative_sd=relative, floor=floor, spacings=tuple(out))


def _vector(values: Reals) -> Vector3:
    x, y, z = (float(v) for v in values)
    return x, y, z
