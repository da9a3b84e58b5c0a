"""Tapered beams written by hand, for tests of their kernel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from structures.frames import Part, bars

NAMES = ("A", "I1", "I2", "I12", "J", "K1", "K2", "NSM", "NSI", "N1", "N2", "M1", "M2")


def tapered(
    connection: ArrayLike,
    material: Mapping[str, ArrayLike],
    stations: Sequence[float],
    values: Mapping[str, Sequence[ArrayLike]],
    **placed: object,
) -> Part:
    """Beams with `values` at `stations`; what is not given is zero, and one value stands for all stations."""
    roles = dict(material)
    for name in NAMES:
        given = list(values.get(name, [0.0]))
        given = given * len(stations) if len(given) == 1 else given
        roles |= {f"{name}@{k}": value for k, value in enumerate(given)}
    like = bars(connection, {}, card="CBEAM", **placed)  # type: ignore[arg-type]
    facts = {**like.facts, "stations": np.tile(np.array(stations, float), (len(like.connection), 1))}
    return Part("tapered-beam", "CBEAM", like.connection, roles, facts)
