"""Antiresonance residual: zeros of the model's undamped FRFs against those of measured ones.

Zeros of a point function are natural frequencies of the structure held at that point: data that modes of the free or
mounted structure do not have.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.errors import FemtuneError, Notice
from femtune.modal import FrfSet
from femtune.modal.assignment import linear_sum_assignment
from femtune.model import EigenSolution
from femtune.model.response import Ports, ZeroFinder, matrix_ports, zero_finder
from femtune.residuals.case import CaseState, Residual
from femtune.residuals.frequency import frequency_residual
from femtune.residuals.frf.measured_zeros import Antiresonance
from femtune.residuals.frf.model_way import ModesWanted, full_modes
from femtune.residuals.frf.residual import Places, places_of
from femtune.residuals.weights import ResidualBlock

# ----------------------------------------------------------------------------------------------------
# Which antiresonance of the model stands against which of the test: by frequency and by the motion of all sensors.


_TELLING = 3
"""Sensors from which on the motion at an antiresonance says which one it is."""


@dataclass(frozen=True)
class ZeroGates:
    """How far a partner may be at the start: relative frequency difference, and MAC of the motions of all responses."""

    frequency: float = 0.30
    mac: float = 0.50


@dataclass(frozen=True, eq=False)
class CandidateZeros:
    """Zeros of one function of the model beside those of the test.

    Parameters
    ----------
    eigenvalues : (m,) μ
    off : (t, m) ln(f_model/f_test), t zeros of the test
    mac : (t, m) of the motions; 1 where fewer than three sensors see them
    """

    eigenvalues: Reals
    off: Reals
    mac: Reals

    def assigned(self) -> list[int | None]:
        """The partner of each zero of the test, together as near and as like as can be; None without."""
        cost = np.abs(self.off) + (1.0 - self.mac)
        out: list[int | None] = [None] * len(cost)
        for i, j in zip(*linear_sum_assignment(cost)):
            out[int(i)] = int(j)
        return out

    def why_not(self, i: int, j: int | None, gates: ZeroGates) -> str:
        """The reason against a pair; "" if there is none."""
        if j is None:
            return "all antiresonances of the model are assigned to others"
        off, mac = float(np.expm1(self.off[i, j])), float(self.mac[i, j])
        if abs(off) > gates.frequency:
            return (
                f"the nearest antiresonance of the model differs by {100.0 * off:+.0f} %; "
                f"the gate is {100.0 * gates.frequency:.0f} %"
            )
        if mac < gates.mac:
            return f"the MAC of the deflection shapes is {mac:.2f}, below {gates.mac:.2f}"
        return ""


def candidates(
    finder: ZeroFinder, output: int, reference: int, tests: Sequence[Antiresonance], reach: float
) -> CandidateZeros:
    """Zeros of a function of the model up to `reach` times the highest one of the test."""
    test_hz = np.array([z.freq_hz for z in tests])
    values = finder.candidates(output, reference, reach * float(test_hz.max()))
    freq = np.sqrt(values) / (2.0 * np.pi)
    motions = np.array([finder.seen(reference, mu) for mu in values]).reshape(
        len(values), finder.ports.outputs.shape[0]
    )
    mac = np.array([[_mac(z.motion, m) for m in motions] for z in tests]).reshape(len(tests), len(values))
    return CandidateZeros(values, np.log(freq[None, :] / test_hz[:, None]), mac)


def _mac(test: NDArray, model: Reals) -> float:
    known = np.isfinite(test)
    a, b = test[known], model[known]
    size = float(np.vdot(a, a).real * (b @ b))
    return float(abs(np.vdot(a, b)) ** 2 / size) if known.sum() >= _TELLING and size > 0.0 else 1.0


ZeroSd = float | Literal["test"]

_LEAST_SD = 1e-7
"""Relative standard deviation of an identified antiresonance at least; data without noise give zero."""
_REACH = 1.5
"""Factor on the highest measured antiresonance up to which zeros of the model are candidates."""


@dataclass(frozen=True, eq=False)
class AntiresonanceResidual(Residual):
    """(f − f_test)/(σ f_test) of antiresonances.

    Parameters
    ----------
    configuration : name
    zeros : antiresonances of the test that have partners
    responses, references : DOFs of the test's functions
    places : where these are in the model
    sd : relative standard deviation, or "test" for that of each fit
    modes : number of modes or upper frequency that are solved for; None takes those of the configuration
    """

    configuration: str
    zeros: tuple[Antiresonance, ...]
    responses: DofSet
    references: DofSet
    places: Places
    sd: ZeroSd = 0.01
    modes: ModesWanted | None = None
    key = "antiresonance"
    label = "antiresonance"
    # zeros need the static response to the forces, and the whole model
    on_modes = False

    @property
    def of_ratio(self) -> bool:
        """See `Residual`."""
        return True

    def blocks(self, state: CaseState, derivatives: bool = True) -> list[ResidualBlock]:
        """Residual blocks of a case at a point, of the full model."""
        return self.compare(full_modes(state, self.modes), derivatives)

    def compare(self, modes: EigenSolution, derivatives: bool = True) -> list[ResidualBlock]:
        """Residual blocks of a solved model.

        Raises
        ------
        FemtuneError : ``residual.antiresonance-lost``, ``response.zero-lost``
        """
        finder = self.finder(modes)
        return [b for tests in self.by_function() for b in self._of_function(finder, tests, derivatives)]

    def finder(self, modes: EigenSolution) -> ZeroFinder:
        """Finder of the zeros of the test's functions in a model."""
        return zero_finder(modes, self._ports(modes))

    def _ports(self, modes: EigenSolution) -> Ports:
        rows = self.places.inputs, self.places.outputs
        return matrix_ports(modes.point.configured, *rows, self.references, self.responses)

    def by_function(self) -> Iterator[list[Antiresonance]]:
        """Zeros of each function that has some."""
        for function in dict.fromkeys((z.response, z.reference) for z in self.zeros):
            yield [z for z in self.zeros if (z.response, z.reference) == function]

    def at(self, zero: Antiresonance) -> tuple[int, int]:
        """Positions of output and input."""
        return self.responses.labels().index(str(zero.response)), self.references.labels().index(str(zero.reference))

    def _of_function(
        self, finder: ZeroFinder, tests: list[Antiresonance], derivatives: bool
    ) -> Iterator[ResidualBlock]:
        place = self.at(tests[0])
        zeros = candidates(finder, *place, tests, _REACH)
        for test, partner in zip(tests, zeros.assigned()):
            if partner is None:
                raise self._lost(test)
            zero = finder.refined(*place, float(zeros.eigenvalues[partner]), derivatives)
            sd = self._sd(test)
            pair = frequency_residual(zero.eigenvalue, zero.gradient, test.freq_hz, sd)
            yield self.block(self.configuration, test.label, *pair, sd)

    def _sd(self, test: Antiresonance) -> float:
        return max(test.sd_hz / test.freq_hz, _LEAST_SD) if self.sd == "test" else float(self.sd)

    def _lost(self, test: Antiresonance) -> FemtuneError:
        return FemtuneError("residual.antiresonance-lost", configuration=self.configuration, antiresonance=test.label)


def antiresonance_residual(
    modes: EigenSolution,
    frfs: FrfSet,
    zeros: tuple[Antiresonance, ...],
    sd: ZeroSd = 0.01,
    places: Places | None = None,
    gates: ZeroGates | None = None,
    wanted: ModesWanted | None = None,
) -> tuple[AntiresonanceResidual, tuple[Notice, ...]]:
    """The residual of those antiresonances of the test that have a partner in the model at the start, and the others.

    Parameters
    ----------
    modes : of the model at the start
    frfs : the test's functions
    zeros : what `measured_antiresonances` finds in them, or some of it
    sd : relative standard deviation, or "test" for that of each fit
    places : where the functions are in the model; the model's DOFs of their labels where nothing is said
    wanted : number of modes or upper frequency that are solved for at other points; None: as the configuration says

    Raises
    ------
    FemtuneError : ``residual.no-antiresonances`` where none has a partner, ``residual.antiresonance-sd``
    """
    _check_sd(sd)
    configured = modes.point.configured
    places = places or places_of(configured.model.structure.nodes, frfs)
    name = configured.configuration.name
    every = AntiresonanceResidual(name, tuple(zeros), frfs.responses, frfs.references, places, sd)
    finder, kept, notices = every.finder(modes), [], []
    for tests in every.by_function():
        candidate_zeros = candidates(finder, *every.at(tests[0]), tests, _REACH)
        for i, (test, partner) in enumerate(zip(tests, candidate_zeros.assigned())):
            why = candidate_zeros.why_not(i, partner, gates or ZeroGates())
            if why:
                notices.append(
                    Notice("residual.antiresonance-unpaired", configuration=name, antiresonance=test.label, reason=why)
                )
            else:
                kept.append(test)
    if not kept:
        raise _no_pairs(name, notices)
    kept_only = AntiresonanceResidual(name, tuple(kept), frfs.responses, frfs.references, places, sd, wanted)
    return kept_only, tuple(notices)


def _check_sd(sd: ZeroSd) -> None:
    if sd != "test" and not (np.isfinite(sd) and sd > 0.0):
        raise FemtuneError("residual.antiresonance-sd", values={"sd": sd})


def _no_pairs(name: str, notices: list[Notice]) -> FemtuneError:
    return FemtuneError(
        "residual.no-antiresonances/none-paired",
        values={str(i + 1): notice.what for i, notice in enumerate(notices[:6])},
        configuration=name,
    )
