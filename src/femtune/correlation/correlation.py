"""Correlation of a test's modes with a model's: everything that is compared, in one result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.correlation.exchanged import Shapes, exchange_notices
from femtune.correlation.noise import NoiseShare, noise_share, orthogonality_noise
from femtune.correlation.pairing import ClusterMatch, Pairing, frequency_errors, pair_modes, visible_modes
from femtune.correlation.reduced_mass import NotTested, ReducedMass
from femtune.correlation.suspension import with_suspension
from femtune.correlation.unit_factor import unit_factor
from femtune.dofs import DofSet
from femtune.errors import Notice
from femtune.modal import ModeSet
from femtune.modal.shape_criteria import (
    comac,
    cross_orthogonality,
    enhanced_comac,
    mac_where_defined,
    mac_without_each,
    motion_agreement,
)

REDUCTION_TOLERANCE = 0.05
"""Cross-orthogonality is refused for modes whose frequency the reduced mass and stiffness miss by more."""

_INVERTED = -0.9
"""Agreement of a sensor with the model over all pairs, from −1 to 1, below which its sign is inverted."""


@dataclass(frozen=True)
class Correlation:
    """Test against model at the sensors.

    Parameters
    ----------
    test, model : what was compared
    mac : (t, m) with the model's own vectors; NaN where a model mode does not move the sensors
    auto_mac_test, auto_mac_model : (t, t) and (m, m)
    pairing : pairs, unpaired and left-out modes with reasons, clusters with rotation and angles
    paired_mac : (p, p) of the paired modes after rotation within clusters; the pairs are on its diagonal
    frequency_errors : (p,) (model − test)/test
    comac : (n,) over the pairs, NaN where undefined or measured in fewer than two of them; DOF labels in `dofs`
    enhanced_comac : (n,) over the pairs, see `femtune.modal.enhanced_comac`; NaN where not measured in any of them
    mac_without : (n, p) MAC of each pair without one of the sensors, see `femtune.modal.mac_without_each`
    cross_orthogonality : (p, p) of the paired modes with the mass reduced to the sensors, or why not
    self_orthogonality : (p, p) of the paired test modes, or why not
    orthogonality_dropped : labels of sensors that both leave out, since they only repeat others
    noise : for each pair the effect of noise of the test shape, or the reason why it is not known
    notices : findings such as sensors that move against the model
    orthogonality_sd, self_sd : (p, p) standard deviations of the off-diagonal terms of the two matrices
        (one standard deviation; on the diagonal of the first the mean loss), or why that is not known
    """

    test: ModeSet
    model: ModeSet
    mac: Reals
    auto_mac_test: Reals
    auto_mac_model: Reals
    pairing: Pairing
    paired_mac: Reals
    frequency_errors: Reals
    comac: Reals
    enhanced_comac: Reals
    mac_without: Reals
    cross_orthogonality: Reals | NotTested
    self_orthogonality: Reals | NotTested
    orthogonality_dropped: tuple[str, ...]
    noise: tuple[NoiseShare, ...] | NotTested
    notices: tuple[Notice, ...]
    orthogonality_sd: Reals | NotTested
    self_sd: Reals | NotTested

    @property
    def dofs(self) -> DofSet:
        """The sensors, rows of `comac`."""
        return self.test.dofs

    @property
    def clusters(self) -> tuple[ClusterMatch, ...]:
        """Clusters compared as subspaces: test and model positions, rotation, principal angles."""
        return self.pairing.clusters

    @property
    def macs(self) -> Reals:
        """(p,) MAC of each pair."""
        return np.array([pair.mac for pair in self.pairing.pairs])

    def one_dof(self, test: int) -> bool:
        """True where a test shape was measured at fewer than two DOFs: its MAC with any shape that moves there is 1."""
        return int(np.count_nonzero(~np.isnan(self.test.shapes[:, test]))) < 2


def correlate(
    test: ModeSet,
    model: ModeSet,
    *,
    mass: ReducedMass | NotTested | None = None,
    frequency_gate: float = 0.30,
    mac_gate: float = 0.50,
    fixed: Sequence[tuple[int, int]] = (),
    never: Sequence[tuple[int, int]] = (),
    left_out: Mapping[int, str] | None = None,
    relative_gap: float = 0.01,
    rigid: int = 0,
) -> Correlation:
    """Compare modes of a test and of a model given at the same DOFs; no pair at all is a result, not an error.

    Parameters
    ----------
    test : shapes real or complex, NaN where not measured
    model : real, mass-normalised over the whole model, sampled at the sensors
    mass : mass reduced to the sensors by `reduce_mass`, or the reason why there is none
    rigid : number of rigid-body modes of the model, its first modes, see `with_suspension`
    others : see `pair_modes`

    Raises
    ------
    FemtuneError : as `pair_modes`
    """
    pairing = pair_modes(
        test,
        model,
        frequency_gate=frequency_gate,
        mac_gate=mac_gate,
        fixed=fixed,
        never=never,
        left_out=left_out,
        relative_gap=relative_gap,
        rigid=rigid,
    )
    pairing = with_suspension(test, model, pairing, rigid)
    psi, phi = paired_shapes(test, model, pairing)
    seen = np.where(visible_modes(model), model.shapes, 0.0)
    cross, self_ = _orthogonality(psi, phi, mass, pairing)
    orthogonality_sd, self_sd = _orthogonality_sd(
        test, psi, phi, mass if not isinstance(cross, NotTested) else None, pairing
    )
    return Correlation(
        test=test,
        model=model,
        mac=mac_where_defined(test.shapes, seen),
        auto_mac_test=mac_where_defined(test.shapes, test.shapes),
        auto_mac_model=mac_where_defined(seen, seen),
        pairing=pairing,
        paired_mac=mac_where_defined(psi, phi),
        frequency_errors=np.array([pair.frequency_error for pair in pairing.pairs]),
        comac=_comac(psi, phi),
        enhanced_comac=_enhanced_comac(psi, phi),
        mac_without=mac_without_each(psi, phi),
        cross_orthogonality=cross,
        self_orthogonality=self_,
        orthogonality_dropped=mass.dropped
        if isinstance(mass, ReducedMass) and not isinstance(cross, NotTested)
        else (),
        noise=_noise(test, pairing),
        notices=(
            *pairing.notices,
            *unit_factor(test, model, pairing),
            *_doubtful_sensors(test, model, pairing, psi, phi),
        ),
        orthogonality_sd=orthogonality_sd,
        self_sd=self_sd,
    )


def paired_shapes(test: ModeSet, model: ModeSet, pairing: Pairing) -> tuple[NDArray, Reals]:
    """Columns of the test's and of the model's shapes pair by pair, the model's rotated within clusters.

    A model mode that the sensors cannot see is a zero column.
    """
    phi = np.where(visible_modes(model), model.shapes, 0.0)[:, list(pairing.model_indices)]
    column = {pair.test: k for k, pair in enumerate(pairing.pairs)}
    for match in pairing.clusters:
        phi[:, [column[i] for i in match.test]] = match.rotation.aligned
    return test.shapes[:, list(pairing.test_indices)], phi


def _defined(psi: NDArray, phi: Reals) -> NDArray[np.bool_]:
    """Pairs whose MAC exists (a pair fixed by hand may have no motion in common)."""
    return ~np.isnan(np.diag(mac_where_defined(psi, phi)))


def _comac(psi: NDArray, phi: Reals) -> Reals:
    """NaN at sensors with fewer than two measured pairs, where the COMAC is 1 whatever the shapes are."""
    keep = _defined(psi, phi)
    if not keep.any():
        return np.full(len(psi), np.nan)
    measured = (~np.isnan(psi[:, keep])).sum(axis=1)
    return np.where(measured < 2, np.nan, comac(psi[:, keep], phi[:, keep]))


def _enhanced_comac(psi: NDArray, phi: Reals) -> Reals:
    keep = _defined(psi, phi)
    return enhanced_comac(psi[:, keep], phi[:, keep]) if keep.any() else np.full(len(psi), np.nan)


def _doubtful_sensors(test: ModeSet, model: ModeSet, pairing: Pairing, psi: NDArray, phi: Reals) -> tuple[Notice, ...]:
    """Sensors that move against the model in every one of several pairs, mounted or wired the other way round, and
    sensors whose channels were exchanged."""
    keep = _defined(psi, phi)
    agreement = motion_agreement(psi[:, keep], phi[:, keep]) if keep.sum() >= 2 else np.zeros(len(psi))
    inverted = [int(k) for k in np.flatnonzero(np.nan_to_num(agreement) < _INVERTED)]
    labels = ", ".join(str(test.dofs[k]) for k in inverted)
    told = (Notice("correlate.sensor-inverted", pairs=keep.sum(), sensors=labels),) if inverted else ()
    return (*told, *exchange_notices(test.dofs, _shapes(test, model, pairing, phi), inverted))


def _shapes(test: ModeSet, model: ModeSet, pairing: Pairing, phi: Reals) -> Shapes:
    """Test shapes with the model modes that the frequency gate allows, and with the partners that they have."""
    error = np.abs(frequency_errors(test.freq_hz, model.freq_hz))
    own = np.zeros((len(test), len(pairing.pairs)), bool)
    own[list(pairing.test_indices), np.arange(len(pairing.pairs))] = True
    seen = visible_modes(model)
    allowed = np.hstack([(error <= pairing.frequency_gate) & seen, own])
    allowed[[u.test for u in pairing.unpaired_test if u.left_out or u.suspension]] = False
    return Shapes(test.shapes, np.hstack([np.where(seen, model.shapes, 0.0), phi]), allowed, np.any(own, axis=1))


def _orthogonality(
    psi: NDArray, phi: Reals, mass: ReducedMass | NotTested | None, pairing: Pairing
) -> tuple[Reals | NotTested, Reals | NotTested]:
    refusal = _refusal(psi, phi, mass, pairing)
    if refusal is not None or not isinstance(mass, ReducedMass):
        return (refusal or NotTested(""),) * 2
    M, kept = mass.mass, list(mass.kept)
    psi, phi = psi[kept], phi[kept]
    return cross_orthogonality(psi, phi, M), cross_orthogonality(psi, psi, M)


def _orthogonality_sd(
    test: ModeSet, psi: NDArray, phi: Reals, mass: ReducedMass | NotTested | None, pairing: Pairing
) -> tuple[Reals | NotTested, Reals | NotTested]:
    if not isinstance(mass, ReducedMass) or test.shapes_sd is None:
        return (NotTested("the standard deviations of the test shapes, or their orthogonality, are not known"),) * 2
    kept = list(mass.kept)
    sd = test.shapes_sd[:, list(pairing.test_indices)][kept]
    return orthogonality_noise(psi[kept], phi[kept], sd, mass.mass)


def _refusal(psi: NDArray, phi: Reals, mass: ReducedMass | NotTested | None, pairing: Pairing) -> NotTested | None:
    """Why cross-orthogonality cannot be tested, or None."""
    if isinstance(mass, NotTested):
        return mass
    if mass is None:
        return NotTested("no mass matrix reduced to the sensors was given")
    if not pairing.pairs:
        return NotTested("no modes are paired")
    kept = list(mass.kept)
    if np.isnan(psi[kept]).any() or not _defined(psi[kept], phi[kept]).all():
        return NotTested("some paired shapes have entries that were not measured, or are zero at the sensors")
    return _inaccurate(mass, pairing.model_indices)


def _inaccurate(mass: ReducedMass, modes: Sequence[int]) -> NotTested | None:
    """Modes with a large frequency error in the reduced model, or without a similar shape in it."""
    errors = {i: float(mass.frequency_error[i]) for i in modes}
    lost = [mass.labels[i] for i, error in errors.items() if np.isnan(error)]
    off = [f"{mass.labels[i]} ({100 * e:+.1f} %)" for i, e in errors.items() if abs(e) > REDUCTION_TOLERANCE]
    limit = f"{100 * REDUCTION_TOLERANCE:.0f} %"
    misses = f"the frequency error of the reduced model exceeds {limit} for {_modes(off)}"
    shapes = f"the reduced model has no mode with the shape of {_modes(lost)}"
    reasons = ([misses] if off else []) + ([shapes] if lost else [])
    if not reasons:
        return None
    needed = "more sensors are needed at points where these modes have large displacements"
    return NotTested(f"{', and '.join(reasons)}; {needed}")


def _modes(labels: Sequence[str]) -> str:
    """Modes in a sentence."""
    *others, last = labels or [""]
    return f"modes {', '.join(others)} and {last}" if others else f"mode {last}"


def _noise(test: ModeSet, pairing: Pairing) -> tuple[NoiseShare, ...] | NotTested:
    if test.shapes_sd is None:
        return NotTested("the standard deviations of the test shapes are not known")
    sd = test.shapes_sd
    return tuple(noise_share(pair.mac, test.shapes[:, pair.test], sd[:, pair.test]) for pair in pairing.pairs)
