"""FRF residual: displacement, mobility or accelerance of model and test, compared line by line.

Source: handbook chapter, displacement residual in the frequency domain; logarithm of the ratio as in FRF calibration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Complexes, Integers, Reals
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.fem import NodeTable
from femtune.identification.redrawn import RedrawnTest
from femtune.modal import FrfSet
from femtune.modal.frf_set import KINDS
from femtune.model import ConfiguredModel, EigenSolution, ModelPoint
from femtune.model.response import Ports, frf_gradient, matrix_ports, survey_functions
from femtune.residuals.case import CaseState, Residual
from femtune.residuals.frf.left_out import LeftOutModes
from femtune.residuals.frf.lines import Region
from femtune.residuals.frf.model_way import ModelWay
from femtune.residuals.kinds import FRF_FORMS, FrfForm
from femtune.residuals.weights import IdentifiedValues, LineSamples, ResidualBlock

# ----------------------------------------------------------------------------------------------------
# Forms of the FRF residual: differences, or the logarithm of the ratio, of model and measured functions.


Pair = tuple[Reals, Reals]


def linear(model: Complexes, slope: Complexes, test: Complexes) -> Pair:
    """H − H_X with real above imaginary parts: values (2n,) and Jacobian (2n, p).

    Parameters
    ----------
    model, slope : H (n,) and ∂H/∂x (n, p)
    test : H_X (n,)
    """
    return _stacked(model - test, slope)


def log_complex(model: Complexes, slope: Complexes, test: Complexes) -> Pair:
    """Principal value of ln(H/H_X): n logarithms of the ratio of magnitudes, then n differences of phase in rad.

    The logarithm is taken of the ratio: the difference of two principal values jumps where one phase passes ±π.
    """
    return _stacked(np.log(model / test), slope / model[:, None])


def log_magnitude(model: Complexes, slope: Complexes, test: Complexes) -> Pair:
    """ln|H/H_X|: values (n,) and Jacobian (n, p)."""
    return np.log(model / test).real, (slope / model[:, None]).real


def _stacked(values: Complexes, slope: Complexes) -> Pair:
    return np.concatenate([values.real, values.imag]), np.concatenate([slope.real, slope.imag])


@dataclass(frozen=True)
class FrfComparison:
    """How FRFs are compared.

    Parameters
    ----------
    compare : H (n,), ∂H/∂x (n, p) and H_X (n,) -> values and Jacobian
    model : values and H_X (n,) -> H (n,); |H| where magnitudes are compared
    """

    compare: Callable[[Complexes, Complexes, Complexes], Pair]
    model: Callable[[Reals, Complexes], Complexes]


def _complex(stacked: Reals) -> Complexes:
    n = len(stacked) // 2
    return stacked[:n] + 1j * stacked[n:]


LINEAR = FrfComparison(linear, lambda r, test: test + _complex(r))
LOG_MAGNITUDE = FrfComparison(log_magnitude, lambda r, test: np.abs(test) * np.exp(r) + 0.0j)
LOG_COMPLEX = FrfComparison(log_complex, lambda r, test: test * np.exp(_complex(r)))


def frf_comparison(form: FrfForm) -> FrfComparison:
    """The comparison of a form."""
    comparison: FrfComparison = FRF_FORMS[form].load()
    return comparison


# ----------------------------------------------------------------------------------------------------
# Where measured FRFs were driven and seen, as rows over the DOFs of all grid points, in every configuration.


@dataclass(frozen=True, eq=False)
class Places:
    """Rows (outputs, n_g) that see motions, and rows (inputs, n_g) of forces, in the order of the functions."""

    outputs: sp.csr_array
    inputs: sp.csr_array

    def ports(self, configured: ConfiguredModel, measured: FrfSet) -> Ports:
        """On the free DOFs of a configuration (error ``response.held-port``)."""
        return matrix_ports(configured, self.inputs, self.outputs, measured.references, measured.responses)


def places_of(nodes: NodeTable, measured: FrfSet) -> Places:
    """Those of functions whose labels are DOFs of the model; errors ``model.unknown-node``, ``model.component``."""
    return Places(_rows(nodes, measured.responses), _rows(nodes, measured.references))


def _rows(nodes: NodeTable, dofs: DofSet) -> sp.csr_array:
    at = [nodes.dof(d.node, d.component) for d in dofs]
    shape = (len(at), nodes.n_dofs)
    return sp.csr_array(([float(d.sign) for d in dofs], (range(len(at)), at)), shape=shape)


@dataclass(frozen=True, eq=False)
class KnownFunctions:
    """A residual's functions at its lines (outputs, inputs, lines), and their derivatives (…, p).

    Parameters
    ----------
    order : of the reduced model, whose basis holds the modes of the full model and its static responses at the point
    """

    values: Complexes
    gradient: Complexes
    order: int


@dataclass(frozen=True, eq=False)
class _Part:
    """One block of the residual.

    Parameters
    ----------
    rows : of its values among those of all blocks, real above imaginary parts
    own : where they stand once the values are ordered by blocks
    scale : `ResidualBlock.sd`
    """

    label: str
    rows: Integers
    own: slice
    scale: float
    samples: LineSamples


@dataclass(frozen=True, eq=False)
class _Compared:
    """Places (n,) of what is compared in the flat functions, σ of real above imaginary parts, and the blocks."""

    places: Integers
    sd: Reals
    parts: tuple[_Part, ...]


@dataclass(frozen=True, eq=False)
class FrfResidual(Residual):
    """H_model against H_test at some lines of some functions, weighted by the standard deviation of each value.

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
    identified : the test that `measured` was computed from; None if it was measured itself
    left_out : modes whose part in the model's functions is taken away
    damped_by : the identified test whose damping ratios the modes of the model have; None if there is none
    noise : (outputs, inputs, lines) standard deviations of the values by the noise that an identification has found,
        over `sd`; None if it is not known
    common : for each block, (values, q) change with q independent errors of unit variance that all values share; empty
        without such errors
    """

    configuration: str
    measured: FrfSet
    places: Places
    sd: Reals
    regions: tuple[Region, ...]
    form: FrfForm = "log-complex"
    way: ModelWay = field(default_factory=ModelWay)
    shift: Reals | None = field(default=None, repr=False)
    identified: RedrawnTest | None = field(default=None, repr=False)
    left_out: LeftOutModes | None = None
    damped_by: RedrawnTest | None = field(default=None, repr=False)
    noise: Reals | None = field(default=None, repr=False)
    common: tuple[Reals, ...] = field(default=(), repr=False)
    key = "frf"
    label = "frf"
    # a reduced model of modes has no residual vectors for the forces and no damping of its own
    on_modes = False

    def blocks(self, state: CaseState, derivatives: bool = True) -> list[ResidualBlock]:
        """Residual blocks of a case at a point, of the full model; of functions that are known there, with these."""
        known = self.known(state)
        if known is None:
            return self.compare(self.way.model(state, self.highest_hz), derivatives)
        return self.compared(known.values, known.gradient if derivatives else known.gradient[..., :0])

    def known(self, state: CaseState) -> KnownFunctions | None:
        """Functions at a state that were found on a reduced model; None if the full model is needed."""
        return state.shared.get(("functions", self))

    def keep(self, state: CaseState, functions: KnownFunctions) -> None:
        """Make functions those of a state."""
        state.shared["functions", self] = functions

    @property
    def highest_hz(self) -> float:
        """The highest line at which the model's functions are computed."""
        return float((self.measured.freq_hz * self._stretch).max())

    def compare(self, model: ModelPoint | EigenSolution, derivatives: bool = True) -> list[ResidualBlock]:
        """Residual blocks of a solved model, or for the direct way without modal damping of its point.

        σ of a block is such that |r|σ is the weighted relative misfit, a complex value counting once.

        Raises
        ------
        FemtuneError : ``residual.frf-not-finite``, and as `frf_gradient`
        """
        return self.compared(*self.functions(model, derivatives))

    def compared(self, values: Complexes, gradient: Complexes) -> list[ResidualBlock]:
        """Residual blocks of functions of the model, (outputs, inputs, lines), and their derivatives (…, p)."""
        compared = self._compared
        of, p = compared.places, gradient.shape[-1]
        test = self.measured.values.ravel()[of]
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes = gradient.reshape(values.size, p)[of]
            residuals, jacobian = frf_comparison(self.form).compare(values.ravel()[of], slopes, test)
        if not (np.isfinite(residuals).all() and np.isfinite(jacobian).all()):
            raise self._not_finite(residuals, jacobian)
        if self.form != "linear" and self.shift is not None:
            residuals[: len(test)] += self.shift.ravel()[of]
        order = np.concatenate([part.rows for part in compared.parts])
        residuals, jacobian = (residuals / compared.sd)[order], (jacobian / compared.sd[:, None])[order]
        return [self._block(part, residuals[part.own], jacobian[part.own]) for part in compared.parts]

    @property
    def block_count(self) -> int:
        """Number of blocks of `compared`."""
        return len(self._compared.parts)

    def values_of(self, blocks: Sequence[ResidualBlock]) -> Complexes:
        """The model's functions (outputs, inputs, lines) that gave these blocks of `compared`; NaN where nothing is
        compared. Magnitudes where the form is "log-magnitude"."""
        compared = self._compared
        residuals = np.empty(len(compared.sd))
        residuals[np.concatenate([part.rows for part in compared.parts])] = np.concatenate([b.values for b in blocks])
        residuals *= compared.sd
        of = compared.places
        if self.form != "linear" and self.shift is not None:
            residuals[: len(of)] -= self.shift.ravel()[of]
        out = np.full(self.sd.size, np.nan, dtype=complex)
        out[of] = frf_comparison(self.form).model(residuals, self.measured.values.ravel()[of])
        return out.reshape(self.sd.shape)

    def functions(self, model: ModelPoint | EigenSolution, derivatives: bool = False) -> tuple[Complexes, Complexes]:
        """The model's functions at the lines, (outputs, inputs, lines), and their derivatives (…, p)."""
        lines, back = self.model_lines
        functions = frf_gradient(
            model, self._ports(model), lines, self.measured.kind, self.way.method,  # type: ignore[arg-type]
            damping=self.way.damping, residual_vectors=self.way.residual_vectors, derivatives=derivatives,
            left_out=self._left_out(model), decay=self.way.decay,
        )  # fmt: skip
        return self.at_lines(functions.frfs.values[:, :, back], functions.gradient[:, :, back])

    def survey(self, model: ModelPoint | EigenSolution) -> Complexes:
        """The model's functions at the lines but for their last digits, see `survey_functions`."""
        lines, back = self.model_lines
        values = survey_functions(
            model, self._ports(model), lines, self.measured.kind, self.way.method,  # type: ignore[arg-type]
            damping=self.way.damping, residual_vectors=self.way.residual_vectors, left_out=self._left_out(model),
            decay=self.way.decay,
        )  # fmt: skip
        return self.at_lines(values[:, :, back], np.zeros((*values.shape, 0)))[0]

    def _left_out(self, model: ModelPoint | EigenSolution) -> tuple[int, ...]:
        if self.left_out is None:
            return ()
        # the study allows modes to be left out of functions that are superposed of modes only
        assert isinstance(model, EigenSolution)
        return self.left_out.of(model)[0]

    @cached_property
    def model_lines(self) -> tuple[Reals, Integers]:
        """The frequencies at which the model's functions are computed, ascending, and that of each line of the test."""
        lines, back = np.unique(self.measured.freq_hz * self._stretch, return_inverse=True)
        return lines, back

    def at_lines(self, values: Complexes, gradient: Complexes) -> tuple[Complexes, Complexes]:
        """The functions at `model_lines`, one for each line of the test, as those of the test.

        A model whose stiffness is scaled so that its peaks meet the test's answers by a factor less.
        """
        factor = self._stretch ** (2.0 - KINDS.index(self.measured.kind))
        return values * factor, gradient * factor[:, None]

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

    def _block(self, part: _Part, values: Reals, jacobian: Reals) -> ResidualBlock:
        block = self.block(self.configuration, part.label, values, jacobian, part.scale)
        return replace(block, samples=part.samples)

    @cached_property
    def _compared(self) -> _Compared:
        """The parts of the blocks that do not change with the model."""
        parts, places, total = list[_Part](), list[Integers](), sum(int(at.sum()) for _, at in self._parts)
        halves = 1 if self.form == "log-magnitude" else 2
        begun = 0
        for number, (label, at) in enumerate(self._parts):
            compared_rows, sd, n = np.flatnonzero(at), self.sd[at], int(at.sum())
            # logarithms are relative already
            size = np.abs(self.measured.values[at]) if self.form == "linear" else 1.0
            scale = float(1.0 / np.sqrt(np.sum((size / sd) ** 2)))
            rows = np.concatenate([half * total + np.arange(begun, begun + n) for half in range(halves)])
            lines, sd = np.tile(self.measured.freq_hz[np.nonzero(at)[2]], halves), np.tile(sd, halves)
            entry, log_sd = np.tile(np.arange(n), halves), None if self.form == "linear" else sd
            noise = None if self.noise is None else np.tile(self.noise[at], halves)
            samples = LineSamples(
                lines, entry, log_sd, self._identified(at), noise, self.common[number] if self.common else None
            )
            parts.append(_Part(label, rows, slice(halves * begun, halves * (begun + n)), scale, samples))
            places.append(compared_rows)
            begun += n
        of = np.concatenate(places) if places else np.zeros(0, np.int64)
        return _Compared(of, np.tile(self.sd.ravel()[of], halves), tuple(parts))

    def _identified(self, at: NDArray[np.bool_]) -> IdentifiedValues | None:
        if self.identified is None:
            return None
        of, (i, j, k) = self.identified.measured, np.nonzero(at)
        rows, columns = self.measured.responses.align(of.responses)[0], self.measured.references.align(of.references)[0]
        lines = np.searchsorted(self.identified.freq_hz, self.measured.freq_hz)
        return IdentifiedValues(self.identified, (rows[i], columns[j], lines[k]), self.sd[at], self.form)

    def _not_finite(self, residuals: Reals, jacobian: Reals) -> FemtuneError:
        bad = ~(np.isfinite(residuals) & np.isfinite(jacobian).all(axis=1))
        label = next(part.label for part in self._compared.parts if bad[part.rows].any())
        return FemtuneError("residual.frf-not-finite", configuration=self.configuration, function=label)
