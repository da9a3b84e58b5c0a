"""Static response to forces, with derivatives; free structures by inertia relief."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.model.configured import ModelPoint
from femtune.model.eigen.solution import EigenSolution
from femtune.model.response.basis import static_complement
from femtune.model.response.dynamic_stiffness import NoSolutionError, Solve, sparse_solver
from femtune.model.response.frf_methods import check_ports
from femtune.model.response.ports import Ports
from femtune.model.response.rigid import is_rigid, rigid_names, with_elastic_mode

_BALANCED = 1e-8
"""Resultant of a load relative to the sum of the magnitudes of its parts up to which it balances."""


@dataclass(frozen=True, eq=False)
class StaticResponse:
    """Displacements of the outputs under a unit of each input, and their derivatives.

    Parameters
    ----------
    values : (outputs, inputs)
    gradient : (outputs, inputs, p) by the normalised free parameters
    inertia_relief : True where the structure is free and the motion is the elastic one, M-orthogonal to all
        rigid-body modes
    """

    values: NDArray
    gradient: NDArray
    outputs: DofSet
    inputs: DofSet
    output_names: tuple[str, ...]
    input_names: tuple[str, ...]
    parameters: tuple[str, ...]
    inertia_relief: bool


def static_response(point: ModelPoint, ports: Ports) -> StaticResponse:
    """u = K⁻¹f at the outputs; an input that is a combination of DOFs is a load case.

    Tables over frequency are taken at 0 Hz, unless the point has a frequency of its own.

    Raises
    ------
    FemtuneError : ``response.static-free`` where the structure is free and a load does not balance, naming the motions
        that are not held; ``response.ports-differ``
    """
    check_ports(point, ports)
    point = point.at_frequency(0.0) if point.depends_on_frequency else point
    B, C = ports.inputs.toarray(), ports.outputs
    solve, rigid = _solver(point, ports, B)
    drift = C @ rigid
    forces = np.hstack([B, C.T.toarray()])
    both = solve(forces)
    x, y = both[:, : B.shape[1]], both[:, B.shape[1] :]
    gradient = [
        -(y.T @ (point.stiffness_derivatives[i] @ x)) - drift @ (rigid.T @ (point.mass_derivatives[i] @ x))
        for i in range(point.n_parameters)
    ]
    values = np.asarray(C @ x)
    free = point.configured.model.parameters.free
    return StaticResponse(
        values, np.stack(gradient, axis=-1) if gradient else np.zeros((*values.shape, 0)), ports.output_labels,
        ports.input_labels, ports.output_names, ports.input_names, tuple(p.name for p in free), bool(rigid.shape[1]),
    )  # fmt: skip


def _solver(point: ModelPoint, ports: Ports, loads: NDArray) -> tuple[Solve, NDArray]:
    """The static solve, and the rigid-body modes (n_free, r) of unit mass where the structure is free."""
    n = point.configured.n_free
    try:
        solve = sparse_solver(point.stiffness)
        # any load at all shows whether something moves freely; loads that balance need not
        solve(np.random.default_rng(4).standard_normal((n, 1)))
        return solve, np.zeros((n, 0))
    except NoSolutionError:
        modes = with_elastic_mode(point)
    r = int(is_rigid(modes).sum())
    if not r:
        raise _inaccurate(point)
    rigid = modes.shapes[:, :r]
    _check_balance(modes, rigid, ports, loads)
    return lambda b: static_complement(modes, r, b), rigid


def _check_balance(modes: EigenSolution, rigid: NDArray, ports: Ports, loads: NDArray) -> None:
    left = np.abs(rigid.T @ loads).max(axis=0)
    size = (np.abs(rigid).T @ np.abs(loads)).max(axis=0)
    bad = np.flatnonzero(left > _BALANCED * size)
    if bad.size:
        name = modes.point.configured.configuration.name
        raise FemtuneError(
            "response.static-free",
            values={"unconstrained motions": ", ".join(rigid_names(modes))},
            name=name,
            load=ports.input_names[bad[0]],
        )


def _inaccurate(point: ModelPoint) -> FemtuneError:
    return FemtuneError("response.static-inaccurate", configuration=point.configured.configuration.name)
