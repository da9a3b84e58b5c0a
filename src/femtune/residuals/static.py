"""Static residuals: displacements under a load, and the forces that measured displacements would need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.model import ConfiguredModel
from femtune.model.response import Ports, matrix_ports, static_response
from femtune.residuals.block import ResidualBlock
from femtune.residuals.case import CaseState
from femtune.residuals.equation import equation_error
from femtune.residuals.weights import Weights, weighted_block

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StaticTest:
    """One load case that was measured.

    Parameters
    ----------
    name : of the load case
    forces : (1, n_g) force on every DOF of the model
    outputs : (s, n_g) what each sensor sees of the DOFs
    measured : (s,) displacements

    Raises
    ------
    FemtuneError : ``residual.static-data``
    """

    name: str
    forces: sp.csr_array
    outputs: sp.csr_array
    measured: Reals

    def __post_init__(self) -> None:
        measured = np.asarray(self.measured, dtype=float)
        if measured.shape != (self.outputs.shape[0],) or not np.isfinite(measured).all() or not measured.any():
            raise FemtuneError(
                "residual.static-data",
                f"load case {self.name}: the measured displacements are not one finite number a sensor, or all zero",
                values={"sensors": self.outputs.shape[0], "displacements": measured.tolist()},
                hint="give the displacement that each sensor showed under this load",
            )

    @property
    def size(self) -> float:
        """Largest measured displacement."""
        return float(np.abs(self.measured).max())

    def ports(self, configured: ConfiguredModel) -> Ports:
        """The load as input and the sensors as outputs (errors as of `matrix_ports`)."""
        outputs = DofSet(Dof(i + 1, "S") for i in range(self.outputs.shape[0]))
        return matrix_ports(configured, self.forces, self.outputs, DofSet([Dof(1, "S")]), outputs, (self.name,))


@dataclass(frozen=True, eq=False)
class DisplacementResidual:
    """u(x) − u_e at the sensors, with u = K⁻¹f; `weights` are of the s displacements, in their unit."""

    test: StaticTest
    weights: Weights
    on_modes = False

    def __post_init__(self) -> None:
        self.weights.check_size(len(self.test.measured), f"the displacements of load case {self.test.name}")

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """One block; a free structure under a load that balances by inertia relief.

        Raises
        ------
        FemtuneError : ``response.static-free``, ``response.held-port``
        """
        point = state.full
        found = static_response(point, self.test.ports(point.configured))
        errors = found.values[:, 0] - self.test.measured
        slopes = found.gradient[:, 0] if derivatives else np.zeros((len(errors), 0))
        name, size = state.case.name, self.test.size * np.sqrt(len(errors))
        return [weighted_block("static displacement", name, self.test.name, errors, slopes, self.weights, size)]


@dataclass(frozen=True, eq=False)
class ForceResidual:
    """f − K(x)u on all free DOFs, u as measured; entries that were not measured are chosen for the least force.

    Linear in the parameters where K is and all of u was measured. `sd` is of a force, in its unit.
    """

    test: StaticTest
    sd: float
    on_modes = False

    def __post_init__(self) -> None:
        Weights(self.sd)

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """One block.

        Raises
        ------
        FemtuneError : ``residual.sensors-dependent``, ``response.held-port``
        """
        point = state.full
        ports = self.test.ports(point.configured)
        force = ports.inputs.toarray()[:, 0]
        slopes = point.stiffness_derivatives if derivatives else ()
        found = equation_error(point.stiffness, slopes, ports.outputs, self.test.measured, force)
        size = float(np.linalg.norm(force)) or 1.0
        values, jacobian = -found.error / self.sd, -found.gradient / self.sd
        return [ResidualBlock("static force", state.case.name, self.test.name, values, jacobian, self.sd / size)]
