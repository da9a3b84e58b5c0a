"""Transfer functions of modes as poles and residues, H(s) = D + Σ Rₖ/(s − λₖ) + conjugates.

In this form responses to sweeps, random vibration and transients have closed forms. Modes are real and damped one by
one: λ = −ζω + iω√(1 − ζ²). With base excitation the modal coordinates are of the motion relative to the base, and an
absolute acceleration is that of the base carried along as a rigid body, plus the relative one; modes that are left out
then follow the base.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from femtune.arrays import Complexes, Reals
from femtune.dofs import DIRECTIONS
from femtune.errors import FemtuneError
from femtune.fem.checks import rigid_body_modes
from femtune.model.eigen.solution import EigenSolution
from femtune.model.response.mass import inertial_forces
from femtune.model.response.modal_damping import DampingRatios
from femtune.model.response.ports import Ports
from femtune.model.response.rigid import is_rigid

Motion = Literal["displacement", "velocity", "acceleration"]
_ORDER = {"displacement": 0, "velocity": 1, "acceleration": 2}


@dataclass(frozen=True, eq=False)
class ModalTransfer:
    """o outputs over i inputs.

    Parameters
    ----------
    poles : (m,) those above the real axis, rad/s; their conjugates are poles too
    residues : (o, i, m)
    direct : (o, i) what is left at high frequency
    outputs, inputs : names
    """

    poles: Complexes
    residues: Complexes
    direct: Reals
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]

    def at(self, freq_hz: Reals) -> Complexes:
        """(o, i, n) transfer functions at frequencies (n,)."""
        s = 2j * np.pi * np.asarray(freq_hz, dtype=float)
        both = 1.0 / (s - self.poles[:, None]), 1.0 / (s - self.poles.conj()[:, None])
        values = np.einsum("oim,mn->oin", self.residues, both[0]) + np.einsum(
            "oim,mn->oin", self.residues.conj(), both[1]
        )
        return np.asarray(values + self.direct[:, :, None])

    @property
    def highest_hz(self) -> float:
        """Natural frequency of the highest mode; 0 without modes."""
        return float(np.abs(self.poles).max(initial=0.0)) / (2.0 * np.pi)

    def accelerations_below(self, freq_hz: float) -> ModalTransfer:
        """Accelerations without the modes above a frequency, and without their part of the direct term."""
        keep = np.abs(self.poles) <= 2.0 * np.pi * freq_hz
        poles, residues = self.poles[~keep], self.residues[:, :, ~keep]
        left_out = (residues * (poles - poles.conj()) / poles**2).real.sum(axis=2)
        return replace(self, poles=self.poles[keep], residues=self.residues[:, :, keep], direct=self.direct - left_out)


def force_transfer(
    modes: EigenSolution, ports: Ports, damping: DampingRatios, motion: Motion = "acceleration"
) -> ModalTransfer:
    """Motion of the outputs over forces at the inputs, of the wanted modes.

    Rigid-body modes contribute to accelerations only; modes that are left out contribute nothing.

    Raises
    ------
    FemtuneError : ``vibration.damping``; ``vibration.free`` for displacements or velocities of a free structure
    """
    shapes = modes.shapes[:, : modes.wanted]
    rigid = is_rigid(modes)[: modes.wanted]
    if rigid.any() and motion != "acceleration":
        raise FemtuneError("vibration.free", motion=motion)
    seen, driven = np.asarray(ports.outputs @ shapes), np.asarray(ports.inputs.T @ shapes)
    poles = _poles(modes.freq_hz, ~rigid, damping)
    parts = np.einsum("om,im->oim", seen, driven)
    direct = parts.sum(axis=2) if motion == "acceleration" else np.zeros(parts.shape[:2])
    residues = parts[:, :, ~rigid] * poles ** _ORDER[motion] / (poles - poles.conj())
    return ModalTransfer(poles, residues, direct, ports.output_names, ports.input_names)


def base_transfer(
    modes: EigenSolution, ports: Ports, direction: str, damping: DampingRatios, *, relative: bool = False
) -> ModalTransfer:
    """Acceleration of the outputs of `ports` over that of the base, which moves all supports as a rigid body.

    Parameters
    ----------
    ports : its outputs; the inputs play no part
    direction : X, Y, Z, RX, RY or RZ in the basic system; rotations are about its origin, in rad/s²
    relative : accelerations relative to the base instead of absolute ones

    Raises
    ------
    FemtuneError : ``vibration.damping``, ``vibration.direction``; ``vibration.no-base`` for a structure that is free
    """
    names = DIRECTIONS[1:]
    if direction not in names:
        raise FemtuneError("vibration.direction", direction=direction, known=", ".join(names))
    if is_rigid(modes)[: modes.wanted].any():
        raise FemtuneError("vibration.no-base")
    axis, configured = names.index(direction), modes.point.configured
    motions = rigid_body_modes(configured.model.structure.nodes)
    shapes = modes.shapes[:, : modes.wanted]
    pushed = (configured.transformation @ shapes).T @ inertial_forces(modes.point, motions)[:, axis]
    seen = np.asarray(ports.outputs @ shapes)
    carried = np.zeros(len(seen)) if relative else np.asarray(ports.outputs @ motions[configured.free, axis])
    on_base = ModesOnBase(modes.freq_hz[: modes.wanted], seen, pushed, carried)
    return transfer_of_base(on_base, damping, ports.output_names, f"base {direction}")


@dataclass(frozen=True, eq=False)
class ModesOnBase:
    """Modes of a structure on its base, of this program or of another solver.

    Parameters
    ----------
    freq_hz : (m,) natural frequencies, without rigid-body modes
    shapes : (o, m) mass-normalised shapes at the outputs
    participation : (m,) participation factors φᵀMr, r the rigid-body motion with the base
    carried : (o,) r at the outputs; zeros for accelerations relative to the base
    """

    freq_hz: Reals
    shapes: Reals
    participation: Reals
    carried: Reals


def transfer_of_base(
    modes: ModesOnBase, damping: DampingRatios, outputs: tuple[str, ...], base: str = "base"
) -> ModalTransfer:
    """Acceleration of the outputs over that of the base.

    Parameters
    ----------
    outputs, base : their names

    Raises
    ------
    FemtuneError : ``vibration.damping``

    Examples
    --------
    A mass of 2 kg on a spring, at 10 Hz; at resonance it moves about 1/2ζ times as much as its base:

    >>> import numpy as np
    >>> from femtune.model.damping import constant_damping
    >>> from femtune.model.vibration import ModesOnBase, transfer_of_base
    >>> one = ModesOnBase(np.array([10.0]), np.array([[2**-0.5]]), np.array([2**0.5]), np.ones(1))
    >>> transfer = transfer_of_base(one, constant_damping(0.02), ("mass",))
    >>> round(float(abs(transfer.at(np.array([10.0]))[0, 0, 0])), 2)
    25.02
    """
    poles = _poles(modes.freq_hz, np.ones(len(modes.freq_hz), bool), damping)
    parts = -(modes.shapes * modes.participation)[:, None, :]
    residues = parts * poles**2 / (poles - poles.conj())
    return ModalTransfer(poles, residues, modes.carried[:, None] + parts.sum(axis=2), outputs, (base,))


def _poles(freq_hz: Reals, which: Sequence[bool] | np.ndarray, damping: DampingRatios) -> Complexes:
    """(m,) of the chosen modes (error ``vibration.damping`` for ratios that are not between 0 and 1)."""
    hz = freq_hz
    ratio = np.asarray(damping.ratio(hz), dtype=float)[np.asarray(which)]
    bad = ~((ratio > 0.0) & (ratio < 1.0))
    if bad.any():
        mode = int(np.flatnonzero(which)[bad][0]) + 1
        raise FemtuneError("vibration.damping", mode=mode, ratio=float(ratio[bad][0]))
    omega = 2.0 * np.pi * hz[np.asarray(which)]
    return np.asarray(omega * (-ratio + 1j * np.sqrt(1.0 - ratio**2)))
