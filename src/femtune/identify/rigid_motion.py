"""Many sensors on a rigid body made into its few motions, by least squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import Channel, TimeSeries

Reals = NDArray[np.float64]


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
    FemtuneError : ``identify.rigid-motion`` where the sizes disagree or the responses do not determine the motions
    """
    at = record.positions("response")
    if rows.shape != (len(at), len(motions)):
        sizes = {"rows": rows.shape, "responses": len(at), "motions": len(motions)}
        raise FemtuneError(
            "identify.rigid-motion", "one row a response and one column a motion are wanted", values=sizes
        )
    if np.linalg.matrix_rank(rows) < len(motions):
        raise FemtuneError(
            "identify.rigid-motion",
            f"the {len(at)} responses do not determine the {len(motions)} motions",
            values={"rank": int(np.linalg.matrix_rank(rows))},
            hint="a floor wants three sensors that do not all point to one line",
        )
    values = record.values[at]
    fitted = np.linalg.lstsq(rows, values, rcond=None)[0]
    rest = (values - rows @ fitted).std(axis=1) / np.maximum(values.std(axis=1), np.finfo(float).tiny)
    others = [i for i in range(len(record)) if i not in at]
    channels = (
        *(Channel(dof, record.channels[at[0]].quantity) for dof in motions),
        *(record.channels[i] for i in others),
    )
    return replace(record, values=np.vstack([fitted, record.values[others]]), channels=channels), np.asarray(rest)
