"""Set-ups that were measured one after another, merged by the references that all of them have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.modal import Channel, ModeSet, TimeSeries


def merge_setups(setups: Sequence[ModeSet], references: DofSet) -> ModeSet:
    """One set of modes at all DOFs; each set-up is scaled to the first one at the references, by least squares.

    Parameters
    ----------
    setups : the same modes in the same order, real or complex shapes, each with all references
    references : DOFs that every set-up has

    Returns
    -------
    ModeSet : frequencies and damping are means over the set-ups, the deviations those of the means; at the references
        the mean of the scaled shapes

    Raises
    ------
    FemtuneError : ``identify.setups`` where the numbers of modes differ, a DOF other than a reference stands in two
        set-ups, or a mode does not move at any reference; ``dof.missing`` for a set-up without a reference
    """
    _check(setups, references)
    first = setups[0].select_dofs(references).shapes
    scaled = [_scaled(s, first, references, i) for i, s in enumerate(setups)]
    common = np.mean([s.select_dofs(references).shapes for s in scaled], axis=0)
    parts, dofs = [common], list(references)
    for one in scaled:
        roving = DofSet(d for d in one.dofs if not _is_in(d, references))
        parts.append(one.select_dofs(roving).shapes)
        dofs += list(roving)
    freq = np.array([s.freq_hz for s in setups])
    return ModeSet(
        freq.mean(axis=0),
        np.vstack(parts),
        DofSet(dofs),
        setups[0].labels,
        _mean_of("damping_ratio", setups),
        freq_sd_hz=_sd_of_mean(freq),
        source=f"{len(setups)} set-ups merged",
    )


def _check(setups: Sequence[ModeSet], references: DofSet) -> None:
    counts = [len(s) for s in setups]
    if len(set(counts)) > 1:
        values = {"modes of each set-up": counts}
        raise FemtuneError("identify.setups", values=values)
    roving = [(d.node, d.direction) for s in setups for d in s.dofs if not _is_in(d, references)]
    twice = sorted({d for d in roving if roving.count(d) > 1})
    if twice:
        named = ", ".join(f"{node}{direction}" for node, direction in twice[:5])
        raise FemtuneError("identify.setups/shared-dof", dofs=named)


def _is_in(dof: Dof, references: DofSet) -> bool:
    return any((dof.node, dof.direction) == (r.node, r.direction) for r in references)


def _scaled(setup: ModeSet, first: NDArray, references: DofSet, number: int) -> ModeSet:
    own = setup.select_dofs(references).shapes
    size = (np.abs(own) ** 2).sum(axis=0)
    still = size <= 1e-12 * (np.abs(setup.shapes) ** 2).sum(axis=0)
    if still.any():
        mode = setup.labels[int(np.argmax(still))]
        raise FemtuneError("identify.setups/no-motion-at-references", mode=mode, number=number + 1)
    factor = (own.conj() * first).sum(axis=0) / size
    return ModeSet(setup.freq_hz, setup.shapes * factor, setup.dofs, setup.labels, setup.damping_ratio)


def _mean_of(name: str, setups: Sequence[ModeSet]) -> Reals | None:
    values = [getattr(s, name) for s in setups]
    return None if any(v is None for v in values) else np.asarray(np.mean(values, axis=0))


def _sd_of_mean(values: Reals) -> Reals | None:
    return None if len(values) < 2 else np.asarray(values.std(axis=0, ddof=1) / np.sqrt(len(values)))


# ----------------------------------------------------------------------------------------------------
# Many sensors on a rigid body made into its few motions, by least squares.


def to_rigid_motion(record: TimeSeries, rows: Reals, motions: DofSet) -> tuple[TimeSeries, Reals]:
    """The motions of rigid bodies that fit all responses best, and what each response has besides them.

    Parameters
    ----------
    record : its responses are taken together; inputs stay as they are
    rows : (responses, motions) what each response sees of each motion
    motions : the DOFs that stand for the motions

    Returns
    -------
    the record of the motions (as responses) and of the inputs, and (responses,) rms of what is left over the rms of the
    response: the body bends, or a sensor is wrong, where it is not small

    Raises
    ------
    FemtuneError : ``identify.rigid-motion`` where the sizes disagree, the responses do not determine the motions or are
        of several quantities
    """
    at = record.positions("response")
    if rows.shape != (len(at), len(motions)):
        sizes = {"rows": rows.shape, "responses": len(at), "motions": len(motions)}
        raise FemtuneError("identify.rigid-motion", values=sizes)
    if np.linalg.matrix_rank(rows) < len(motions):
        raise FemtuneError(
            "identify.rigid-motion/not-determined",
            values={"rank": int(np.linalg.matrix_rank(rows))},
            n_responses=len(at),
            n_motions=len(motions),
        )
    quantities = sorted({record.channels[i].quantity for i in at})
    if len(quantities) > 1:
        raise FemtuneError("identify.rigid-motion/quantities", quantities=", ".join(quantities))
    values = record.values[at]
    fitted = np.linalg.lstsq(rows, values, rcond=None)[0]
    rest = (values - rows @ fitted).std(axis=1) / np.maximum(values.std(axis=1), np.finfo(float).tiny)
    others = [i for i in range(len(record)) if i not in at]
    channels = (
        *(Channel(dof, record.channels[at[0]].quantity) for dof in motions),
        *(record.channels[i] for i in others),
    )
    return replace(record, values=np.vstack([fitted, record.values[others]]), channels=channels), np.asarray(rest)
