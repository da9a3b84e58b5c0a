"""Sensors on rigid bodies, floors above all, reduced to the motions of these bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femtune.dofs import DIRECTIONS, Dof, DofSet, parse_dof
from femtune.errors import FemtuneError, Notice
from femtune.files.identification_file import IdentifyFile, RigidBodyEntry
from femtune.identification.setups import to_rigid_motion
from femtune.modal import TimeSeries
from femtune.testdata import WireFrame

LARGEST_REMAINDER = 0.2
"""Part of the signal of a sensor that the rigid motions may leave unexplained.

Noise leaves a small part; a sensor on a flexible part, or with a wrong direction, leaves a large one.
"""


def with_rigid_bodies(
    record: TimeSeries, file: IdentifyFile, geometry: WireFrame | None
) -> tuple[TimeSeries, tuple[Notice, ...]]:
    """The record with the motions of the bodies in place of their sensors.

    Raises
    ------
    FemtuneError : ``identify.rigid-bodies`` without places of the sensors, ``identify.rigid-motion``
    """
    notices: tuple[Notice, ...] = ()
    for i, body in enumerate(file.rigid_body):
        record, motions = _reduced(record, file, body, i, geometry)
        notices = (*notices, *motions)
    return record, notices


def _reduced(
    record: TimeSeries, file: IdentifyFile, body: RigidBodyEntry, i: int, geometry: WireFrame | None
) -> tuple[TimeSeries, tuple[Notice, ...]]:
    wanted = DofSet(parse_dof(label) for label in body.sensors)
    at = [k for k, c in enumerate(record.channels) if c.role != "input" and c.dof in wanted]
    where = file.where("rigid_body", i)
    if not at:
        raise FemtuneError("identify.rigid-bodies/no-sensor", where=where, node=body.node)
    channels = [record.channels[k] for k in at]
    nodes = [body.node, *(c.dof.node for c in channels)]
    missing = sorted({n for n in nodes if geometry is None or n not in geometry})
    if missing or geometry is None:
        listed = ", ".join(map(str, missing[:8]))
        raise FemtuneError("identify.rigid-bodies/geometry", where=where, node=body.node, missing=listed)
    rows = np.array([_row(geometry, c.dof, body) for c in channels])
    motions = DofSet(Dof(body.node, DIRECTIONS[int(digit)]) for digit in body.motions)
    of_body = replace(record.select_channels(at), channels=tuple(replace(c, role="response") for c in channels))
    made, rest = to_rigid_motion(of_body, rows, motions)
    role = "reference" if any(c.role == "reference" for c in channels) else "response"
    others = [k for k in range(len(record)) if k not in at]
    kept = record.select_channels(others)
    channels_made = tuple(replace(c, role=role, unit=channels[0].unit) for c in made.channels)
    joined = replace(record, values=np.vstack([made.values, kept.values]), channels=(*channels_made, *kept.channels))
    poor = [f"{c.dof} ({r:.0%})" for c, r in zip(channels, rest) if r > LARGEST_REMAINDER]
    notice = Notice("identify.rigid-bodies", where=where, sensors=", ".join(poor)) if poor else None
    return joined, (notice,) if notice else ()


def _row(geometry: WireFrame, dof: Dof, body: RigidBodyEntry) -> list[float]:
    """What a sensor sees of the motions of a body: n·(u + ω × r), or n·ω for a rotation."""
    along, arm = geometry.direction(dof), geometry.position(dof.node) - geometry.position(body.node)
    turning = dof.component > 3
    whole = np.concatenate([np.zeros(3), along] if turning else [along, np.cross(arm, along)])
    return [float(whole[int(digit) - 1]) for digit in body.motions]
