"""Static residuals: displacements under a load, and the forces that measured displacements would need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Reals
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.model import ConfiguredModel
from femtune.model.response import Ports, matrix_ports, static_response
from femtune.residuals.asked import Asked, asked_weights
from femtune.residuals.case import CaseState, Residual
from femtune.residuals.dynamic import equation_error
from femtune.residuals.weights import ResidualBlock, Weights


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
                values={"sensors": self.outputs.shape[0], "displacements": measured.tolist()},
                load_case=self.name,
            )

    @property
    def size(self) -> float:
        """Largest measured displacement."""
        return float(np.abs(self.measured).max())

    def ports(self, configured: ConfiguredModel) -> Ports:
        """The load as input and the sensors as outputs (errors as of `matrix_ports`)."""
        outputs = DofSet(Dof(i + 1, "S") for i in range(self.outputs.shape[0]))
        return matrix_ports(configured, self.forces, self.outputs, DofSet([Dof(1, "S")]), outputs, (self.name,))


def _asked_test(asked: Asked) -> StaticTest:
    """The load case of a table (errors ``response.zero-load``, ``residual.static-data``, as of `Asked.rows`)."""
    entry = asked.entry
    rows, seen = asked.rows("forces"), asked.rows("displacements")
    load = sp.csr_array(sp.csr_array(np.array([list(entry.forces.values())])) @ rows)
    if not np.any(load.data):
        raise FemtuneError("response.zero-load/of-residual", where=asked.where("forces"), residual=entry.name)
    with asked.errors_at("displacements"):
        return StaticTest(entry.name, load, seen, np.array(list(entry.displacements.values())))


@dataclass(frozen=True, eq=False)
class DisplacementResidual(Residual):
    """u(x) − u_e at the sensors, with u = K⁻¹f; `weights` are of the s displacements, in their unit."""

    test: StaticTest
    weights: Weights
    key = "static-displacement"
    label = "static displacement"

    @classmethod
    def of_study(cls, asked: Asked) -> DisplacementResidual:
        """See `Residual`; errors as of `_asked_test`, ``residual.weights``, ``residual.covariance``."""
        test = _asked_test(asked)
        return cls(test, asked_weights(asked, len(test.measured), "the displacements", test.size))

    def __post_init__(self) -> None:
        self.weights.check_size(len(self.test.measured), f"the displacements of load case {self.test.name}")

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """One block; a free structure under a load that balances by inertia relief.

        Raises
        ------
        FemtuneError : ``response.static-free``, ``response.held-port``
        """
        point = state.full
        response = static_response(point, self.test.ports(point.configured))
        errors = response.values[:, 0] - self.test.measured
        slopes = response.gradient[:, 0] if derivatives else np.zeros((len(errors), 0))
        name, size = state.case.name, self.test.size * np.sqrt(len(errors))
        return [self.weighted(name, self.test.name, errors, slopes, self.weights, size)]


@dataclass(frozen=True, eq=False)
class ForceResidual(Residual):
    """f − K(x)u on all free DOFs, u as measured; entries that were not measured are chosen for the least force.

    Linear in the parameters where K is and all of u was measured. `sd` is of a force, in its unit.
    """

    test: StaticTest
    sd: float
    key = "static-force"
    label = "static force"

    @classmethod
    def of_study(cls, asked: Asked) -> ForceResidual:
        """See `Residual`; errors as of `_asked_test`."""
        return cls(_asked_test(asked), asked.entry.sd)

    def __post_init__(self) -> None:
        Weights(self.sd)

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """One block, of whose values as many are independent as displacements were measured.

        Raises
        ------
        FemtuneError : ``residual.sensors-dependent``, ``response.held-port``
        """
        point = state.full
        ports = self.test.ports(point.configured)
        force = ports.inputs.toarray()[:, 0]
        slopes = point.stiffness_derivatives if derivatives else ()
        error = equation_error(point.stiffness, slopes, ports.outputs, self.test.measured, force)
        size = float(np.linalg.norm(force)) or 1.0
        values, jacobian = -error.error / self.sd, -error.gradient / self.sd
        lost = len(values) - len(self.test.measured)
        return [self.block(state.case.name, self.test.name, values, jacobian, self.sd / size, lost=lost)]
