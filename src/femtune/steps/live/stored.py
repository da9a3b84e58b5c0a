"""The live model as it is stored with the results: what a page solves, for use in Python."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.model.live import ChebyshevFunctions, LiveDamping, LiveModel, LivePorts, LiveTerm

if TYPE_CHECKING:
    from femtune.steps.live.record import LiveConfiguration, LiveResults


def stored_model(results: LiveResults, configuration: str, arrays: Mapping[str, NDArray[Any]]) -> LiveModel:
    """The live model of a configuration, from the arrays of a run.

    Parameters
    ----------
    results : with a live model
    configuration : its name
    arrays : by the keys that the results refer to

    Raises
    ------
    ValueError : if there is none of that name
    """
    return _model(results, _named(results, configuration), arrays)


def stored_functions(results: LiveResults, configuration: str, arrays: Mapping[str, NDArray[Any]]) -> list[LivePorts]:
    """The FRFs of the live model of a configuration; parameters and errors as `stored_model`."""
    return [
        LivePorts(
            f.kind, arrays[f.outputs_key].astype(float), arrays[f.inputs_key].astype(float), arrays[f.freq_key],
            f.modes,
            LiveDamping(np.array(f.damping_ratios), np.array(f.damping_hz), f.hysteretic, f.loss_factor),
        )
        for f in _named(results, configuration).functions
    ]  # fmt: skip


def _named(results: LiveResults, configuration: str) -> LiveConfiguration:
    for one in results.configurations:
        if one.configuration == configuration:
            return one
    raise ValueError(f"there is no live model of a configuration called {configuration!r}")


def _model(results: LiveResults, one: LiveConfiguration, arrays: Mapping[str, NDArray[Any]]) -> LiveModel:
    scale, nominal = (np.array([getattr(p, name) for p in results.parameters]) for name in ("scale", "nominal"))
    lower, upper = (
        (np.array([getattr(p, name) for p in results.parameters]) - nominal) / scale for name in ("lower", "upper")
    )
    polynomials, triangles = arrays[one.polynomials_key], arrays[one.triangles_key]
    terms = tuple(
        LiveTerm(
            t.kind,
            ChebyshevFunctions(
                t.parameters, polynomials[t.first : t.first + int(np.prod(t.shape))].reshape(1, *t.shape)
            ),
            triangle, t.scale,
        )
        for t, triangle in zip(one.terms, triangles)
    )  # fmt: skip
    assert results.x_key is not None
    return LiveModel(arrays[results.x_key], lower, upper, arrays[one.theta_key], one.shift, one.count, terms)
