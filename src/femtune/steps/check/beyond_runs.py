"""Bounds of parameters beside the runs of the model: an update that ends outside them extrapolates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import Notice

if TYPE_CHECKING:
    from femtune.study.study import Study

_BEYOND = 0.1
"""Part of the range of the runs by which bounds exceed it at least: a design such as a Latin hypercube fills the box of
the bounds up to the distance of its runs."""


def bounds_beyond_runs(study: Study) -> Iterator[Notice]:
    """A warning for each parameter whose bounds reach beyond the range of the runs."""
    if study.file.runs is None:
        return
    free = study.parameters.free
    for i, parameter in enumerate(free):
        beyond = dict[str, tuple[float, float, float]]()
        for end in study.parameters.bounds:
            x = np.zeros(len(free))
            x[i] = end[i]
            values = {ref.name: value for ref, value in study.model.field_values(x).items()}
            for part in study.built.coverage:
                beyond |= {
                    name: (values[name], low, high)
                    for name, low, high in part.outside(values)
                    if max(low - values[name], values[name] - high) > _BEYOND * (high - low)
                }
        for name, (value, low, high) in beyond.items():
            yield Notice(
                "study.bounds-beyond-runs", where=study.file.where("parameter", i), parameter=parameter.name,
                variable=name, value=value, low=low, high=high,
            )  # fmt: skip
