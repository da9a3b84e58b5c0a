"""Mass normalisation of shapes of unmeasured excitation, by a second record with known masses added.

From K ψ₀ = ω₀² M ψ₀ and K ψ₁ = ω₁² (M + ΔM) ψ₁ follows, without an approximation,
ψ₀ᵀ M ψ₁ = ω₁² ψ₀ᵀ ΔM ψ₁ / (ω₀² − ω₁²). If the masses are small, ψ₁ is nearly ψ₀ and this is the modal mass.

Source: E. Parloo, P. Verboven, P. Guillaume, M. Van Overmeire, Mechanical Systems and Signal Processing 16 (2002), 757;
M. López-Aenlle, R. Brincker, F. Pelayo, A. Fernández Canteli, Journal of Sound and Vibration 331 (2012), 622.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError, Notice
from femtune.modal import ModeSet, mac
from femtune.modal.subspace import mostly_real

SAME_MODE = 0.9
"""MAC of the modes of the two records from which they are the same one: the masses must hardly change a shape."""
KNOWN_SHIFT = 3.0
"""Standard deviations that the shift of a frequency has at least: the scale has half its relative error."""


@dataclass(frozen=True, eq=False)
class ScaledByMasses:
    """Modes with mass-normalised shapes.

    Parameters
    ----------
    modes : the modes of the structure without the masses that could be scaled
    scale_sd : (m,) relative standard deviations of the scales, from those of the frequencies; NaN without these
    shift : (m,) relative shifts of the frequencies by the masses
    mac : (m,) of the shapes with and without the masses: what it lacks of 1 is an error of the scale
    notices : the modes that could not be scaled
    """

    modes: ModeSet
    scale_sd: Reals
    shift: Reals
    mac: Reals
    notices: tuple[Notice, ...]


def scale_by_masses(before: ModeSet, after: ModeSet, masses: Mapping[Dof, float]) -> ScaledByMasses:
    """Shapes scaled to unit modal mass by the shifts that added masses cause.

    Parameters
    ----------
    before, after : modes without and with the masses; modes of the same shape belong together. Complex shapes are
        turned to the phase with the largest real part, which is taken
    masses : mass at each DOF in which it moves; a mass that moves in two measured directions is given at both DOFs

    Raises
    ------
    FemtuneError : ``identify.added-mass`` for masses that are not positive or not at DOFs of both sets, or if no mode
        can be scaled

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.dofs import DofSet, parse_dof
    >>> from femtune.modal import ModeSet
    >>> dofs = DofSet.parse(["1Z+"])
    >>> hz = np.sqrt([100.0 / 2.0, 100.0 / 2.1]) / (2.0 * np.pi)  # 2 kg on a spring of 100 N/m, and 0.1 kg more
    >>> plain, loaded = (ModeSet(hz[[i]], np.array([[1.0]]), dofs) for i in (0, 1))
    >>> scale_by_masses(plain, loaded, {parse_dof("1Z+"): 0.1}).modes.shapes**-2
    array([[2.]])
    """
    shared = before.dofs.common(after.dofs)
    weights = _weights(shared, masses)
    first, second = _shapes(before, shared), _shapes(after, shared)
    alike = mac(first, second)
    kept: list[int] = []
    pairs: list[tuple[float, float, float, float]] = []
    notices: list[Notice] = []
    for i, hz in enumerate(before.freq_hz.tolist()):
        k = int(alike[i].argmax()) if len(after) else 0
        if not len(after) or alike[i, k] < SAME_MODE or alike[:, k].argmax() != i:
            best = float(alike[i, k]) if len(after) else 0.0
            notices.append(Notice("identify.added-mass/no-partner", frequency_hz=hz, mac=best, least=SAME_MODE))
            continue
        errors = [0.0 if s.freq_sd_hz is None else float(s.freq_sd_hz[at]) for s, at in ((before, i), (after, k))]
        loaded = float(after.freq_hz[k])
        if hz - loaded <= KNOWN_SHIFT * float(np.hypot(errors[0], errors[1])):
            notices.append(Notice("identify.added-mass/no-shift", frequency_hz=hz, loaded_hz=loaded))
            continue
        known = np.isfinite(first[:, i]) & np.isfinite(second[:, k])
        if weights[~known].any():
            notices.append(Notice("identify.added-mass/not-seen", frequency_hz=hz))
            continue
        shape, other = first[known, i], second[known, k]
        other = other * (shape @ other) / (other @ other)
        change = hz**2 - loaded**2
        modal_mass = loaded**2 * float(shape @ (weights[known] * other)) / change
        if modal_mass <= 0.0:
            notices.append(Notice("identify.added-mass/no-shift", frequency_hz=hz, loaded_hz=loaded))
            continue
        # φ = ψ/√m: half the relative error of m
        sd = float(np.hypot(hz * errors[0] / change, loaded * errors[1] * (1.0 / loaded**2 + 1.0 / change)))
        stated = before.freq_sd_hz is not None and after.freq_sd_hz is not None
        kept.append(i)
        pairs.append((modal_mass, sd if stated else float("nan"), loaded / hz - 1.0, float(alike[i, k])))
    if not kept:
        raise FemtuneError("identify.added-mass/none", values={"modes": len(before), "with masses": len(after)})
    mass, scale_sd, shift, same = np.array(pairs).T
    return ScaledByMasses(_scaled(before, np.array(kept), mass, scale_sd), scale_sd, shift, same, tuple(notices))


def _weights(shared: DofSet, masses: Mapping[Dof, float]) -> Reals:
    wrong = [f"{dof}: {mass:g}" for dof, mass in masses.items() if not (np.isfinite(mass) and mass > 0.0)]
    missing = [str(dof) for dof in masses if dof not in shared]
    if wrong or missing or not masses:
        values = {"not positive": ", ".join(wrong[:5]), "not measured in both": ", ".join(missing[:5])}
        raise FemtuneError("identify.added-mass", values={name: text for name, text in values.items() if text})
    by_place = {(dof.node, dof.direction): mass for dof, mass in masses.items()}
    return np.array([by_place.get((dof.node, dof.direction), 0.0) for dof in shared])


def _shapes(modes: ModeSet, shared: DofSet) -> Reals:
    at, signs = shared.align(modes.dofs)
    return signs[:, None] * np.column_stack([mostly_real(shape) for shape in modes.shapes[at].T])


def _scaled(modes: ModeSet, kept: Integers, mass: Reals, scale_sd: Reals) -> ModeSet:
    own = modes.select_modes(kept.tolist())
    shapes = np.column_stack([mostly_real(shape) for shape in own.shapes.T]) / np.sqrt(mass)
    deviations = None
    if own.shapes_sd is not None and np.isfinite(scale_sd).all():
        deviations = np.hypot(own.shapes_sd / np.sqrt(mass), shapes * scale_sd)
    return replace(own, shapes=shapes, shapes_sd=deviations, normalisation="mass", modal_a=None)
