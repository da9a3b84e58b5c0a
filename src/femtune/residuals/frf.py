"""FRF residual: displacement, mobility or accelerance of model and test, compared line by line.

Source: handbook chapter, displacement residual in the frequency domain; logarithm of the ratio as in FRF calibration.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.modal import FrfSet
from femtune.modal.frf_set import KINDS
from femtune.model import EigenSolution, ModelPoint
from femtune.model.response import Ports, frf_gradient
from femtune.residuals.block import ResidualBlock
from femtune.residuals.case import CaseState
from femtune.residuals.frf_forms import FORMS, FrfForm
from femtune.residuals.frf_lines import Region
from femtune.residuals.frf_places import Places
from femtune.residuals.model_way import ModelWay

Reals = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class FrfResidual:
    """H_model against H_test at some lines of some functions, weighted by the scatter of each value.

    Parameters
    ----------
    configuration : name
    measured : functions at the lines that are compared only
    places : where they were driven and seen
    sd : (outputs, inputs, lines) σ of real and imaginary parts of values or of their logarithms, as the form is; NaN
        where nothing is compared
    regions : parts of the lines; those with a label make a block each over all functions, those without one a block
        for each function
    form : "linear", "log-magnitude" or "log-complex"
    way : how the model's functions are computed
    shift : (outputs, inputs, lines) added to logarithms of magnitudes, against the bias of their weights
    """

    configuration: str
    measured: FrfSet
    places: Places
    sd: Reals
    regions: tuple[Region, ...]
    form: FrfForm = "log-complex"
    way: ModelWay = field(default_factory=ModelWay)
    shift: Reals | None = field(default=None, repr=False)

    @property
    def on_modes(self) -> bool:
        """False: a reduced model of modes has no residual vectors for the forces and no damping of its own."""
        return False

    def blocks(self, state: CaseState, derivatives: bool = True) -> list[ResidualBlock]:
        """Residual blocks of a case at a point, of the full model."""
        return self.compare(self.way.model(state), derivatives)

    def compare(self, model: ModelPoint | EigenSolution, derivatives: bool = True) -> list[ResidualBlock]:
        """Residual blocks of a solved model, or for the direct way without modal damping of its point.

        σ of a block is such that |r|σ is the weighted relative misfit, a complex value counting once.

        Raises
        ------
        FemtuneError : ``residual.frf-not-finite``, and as `frf_gradient`
        """
        values, gradient = self.functions(model, derivatives)
        return [self._block(label, at, values[at], gradient[at]) for label, at in self._parts]

    def functions(self, model: ModelPoint | EigenSolution, derivatives: bool = False) -> tuple[Complexes, Complexes]:
        """The model's functions at the lines, (outputs, inputs, lines), and their derivatives (…, p)."""
        lines, back = np.unique(self.measured.freq_hz * self._stretch, return_inverse=True)
        found = frf_gradient(
            model, self._ports(model), lines, self.measured.kind, self.way.method,  # type: ignore[arg-type]
            damping=self.way.damping, residual_vectors=self.way.residual_vectors, derivatives=derivatives,
        )  # fmt: skip
        # a model whose stiffness is scaled so that its peaks meet the test's answers by this factor less
        factor = self._stretch ** (2.0 - KINDS.index(self.measured.kind))
        return found.frfs.values[:, :, back] * factor, found.gradient[:, :, back] * factor[:, None]

    def _ports(self, model: ModelPoint | EigenSolution) -> Ports:
        point = model.point if isinstance(model, EigenSolution) else model
        return self.places.ports(point.configured, self.measured)

    @cached_property
    def _stretch(self) -> Reals:
        out = np.ones(len(self.measured.freq_hz))
        for region in self.regions:
            out[region.at] = region.stretch
        return out

    @cached_property
    def _parts(self) -> list[tuple[str, NDArray[np.bool_]]]:
        """Label and (outputs, inputs, lines) places of each block that has some."""
        return [(label, at) for label, at in self._candidates() if at.any()]

    def _candidates(self) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        compared = np.isfinite(self.sd)
        for region in self.regions:
            at = np.zeros_like(compared)
            at[:, :, region.at] = compared[:, :, region.at]
            if region.label:
                yield region.label, at
            else:
                yield from self._by_function(at)

    def _by_function(self, at: NDArray[np.bool_]) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        for i, j in np.ndindex(at.shape[:2]):
            one = np.zeros_like(at)
            one[i, j] = at[i, j]
            yield f"{self.measured.responses[i]} / {self.measured.references[j]}", one

    def _block(self, label: str, at: NDArray[np.bool_], model: Complexes, slope: Complexes) -> ResidualBlock:
        test, sd = self.measured.values[at], self.sd[at]
        with np.errstate(divide="ignore", invalid="ignore"):
            values, jacobian = FORMS[self.form](model, slope, test)
        if not (np.isfinite(values).all() and np.isfinite(jacobian).all()):
            raise self._not_finite(label)
        if self.form != "linear" and self.shift is not None:
            values[: len(test)] += self.shift[at]
        # logarithms are relative already
        size = np.abs(test) if self.form == "linear" else 1.0
        scale = float(1.0 / np.sqrt(np.sum((size / sd) ** 2)))
        sd = np.tile(sd, len(values) // len(test))
        return ResidualBlock("frf", self.configuration, label, values / sd, jacobian / sd[:, None], scale)

    def _not_finite(self, label: str) -> FemtuneError:
        return FemtuneError(
            "residual.frf-not-finite",
            f"configuration {self.configuration}: the model's FRF {label} is zero or not finite at a line, so that it "
            "has no logarithm",
            hint='take form = "linear", or give the model some damping',
        )
