"""StateSpace: a linear system between references and responses that can be evaluated at any frequency."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur

from femtune.arrays import Complexes, Reals
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal.frf_set import KINDS, FrfSet
from femtune.modal.mode_set import read_only


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A linear system ẋ = Ax + Bu, y = Cx + Du, or x⁺ = Ax + Bu if it is sampled; its arrays are read-only.

    Parameters
    ----------
    A, B, C, D : (n, n), (n, references), (responses, n), (responses, references), real
    responses, references : the DOFs of y and u
    kind : kind of the FRFs from a force u to y
    sampling_hz : None for continuous time
    source : origin of the system, a text

    Raises
    ------
    FemtuneError : ``system.shape`` if the sizes disagree, ``system.values`` for entries that are not finite,
        ``frf.kind``
    """

    A: Reals
    B: Reals
    C: Reals
    D: Reals
    responses: DofSet
    references: DofSet
    kind: str
    sampling_hz: float | None = None
    source: str = ""

    def __post_init__(self) -> None:
        for name in "ABCD":
            object.__setattr__(self, name, read_only(getattr(self, name), float))
        if self.kind not in KINDS:
            raise FemtuneError("frf.kind", kind=self.kind, kinds=", ".join(KINDS))
        self._check_sizes()

    def _check_sizes(self) -> None:
        n, y, u = len(self.A), len(self.responses), len(self.references)
        for name, wanted in (("A", (n, n)), ("B", (n, u)), ("C", (y, n)), ("D", (y, u))):
            matrix = getattr(self, name)
            if matrix.shape != wanted:
                raise FemtuneError("system.shape", name=name, matrix_shape=matrix.shape, required_shape=wanted)
            if not np.isfinite(matrix).all():
                raise FemtuneError("system.values", name=name)

    def transposed(self) -> StateSpace:
        """The system with responses and references exchanged, H ↦ Hᵀ."""
        return replace(
            self, A=self.A.T, B=self.C.T, C=self.B.T, D=self.D.T, responses=self.references, references=self.responses
        )

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.A)

    def poles(self) -> Complexes:
        """(n,) poles in rad/s, of continuous time even if the system is sampled, by ascending modulus.

        A pole of a sampled system at zero (a delay) becomes −∞.
        """
        values = np.linalg.eigvals(self.A).astype(complex) if self.order else np.zeros(0, complex)
        values = continuous_poles(values, self.sampling_hz)
        return values[np.lexsort((values.imag, np.abs(values)))]

    def frf(self, freq_hz: Reals) -> FrfSet:
        """H = C (zI − A)⁻¹ B + D with z = iω, or e^{iω/rate} if the system is sampled.

        Parameters
        ----------
        freq_hz : (k,) ascending

        Raises
        ------
        FemtuneError : ``system.at-pole`` if a frequency lies on an undamped pole
        """
        lines = np.asarray(freq_hz, float)
        values = self._transfer(lines)
        if not np.isfinite(values).all():
            bad = lines[~np.isfinite(values).all(axis=(0, 1))]
            raise FemtuneError("system.at-pole", freq_hz=bad[0])
        return FrfSet(lines, values, self.responses, self.references, self.kind, source=self.source)

    def _transfer(self, lines: Reals) -> Complexes:
        """Back substitution in a Schur form, which needs no special case for a defective A (rigid-body motion)."""
        y, u, k = len(self.responses), len(self.references), len(lines)
        if not self.order:
            return np.repeat(self.D[:, :, None], k, axis=2).astype(complex)
        z = 2j * np.pi * lines
        z = z if self.sampling_hz is None else np.exp(z / self.sampling_hz)
        T, Q = schur(self.A, output="complex")
        x = _resolvent(T, Q.conj().T @ self.B, z)
        with np.errstate(invalid="ignore"):
            flat = (self.C @ Q) @ x.reshape(self.order, u * k)
        return flat.reshape(y, u, k) + self.D[:, :, None]


def continuous_poles(values: Complexes, sampling_hz: float | None) -> Complexes:
    """Poles in rad/s of eigenvalues of A: rate · ln μ for a sampled system, else the values themselves."""
    if sampling_hz is None:
        return values
    delays = values == 0.0
    return np.where(delays, -np.inf + 0j, sampling_hz * np.log(np.where(delays, 1.0, values)))


def freq_and_damping(poles: Complexes) -> tuple[Reals, Reals]:
    """Natural frequencies |λ|/2π in Hz and damping ratios −Re λ/|λ| (0 for λ = 0) of poles in rad/s."""
    size = np.abs(poles)
    return size / (2.0 * np.pi), -poles.real / np.where(size > 0.0, size, 1.0)


def pole_of(freq_hz: Reals, damping_ratio: Reals) -> Complexes:
    """Poles in the upper half plane, |λ|(−ζ + i√(1−ζ²)), of |ζ| < 1."""
    omega = 2.0 * np.pi * np.asarray(freq_hz, float)
    zeta = np.asarray(damping_ratio, float)
    return omega * (-zeta + 1j * np.sqrt(1.0 - zeta**2))


def system_modes(system: StateSpace) -> tuple[Complexes, Complexes, Complexes]:
    """Poles λ, shapes ψ = C v and participations w = wᵀB of every pole: H = Σ ψ wᵀ/(z − μ) + D.

    Returns
    -------
    poles (n,) in rad/s of continuous time, shapes (responses, n), participations (n, references), in the order of the
        eigenvalues of A and including conjugate pairs
    """
    values, v = np.linalg.eig(system.A)
    poles = continuous_poles(values.astype(complex), system.sampling_hz)
    return poles, system.C @ v, np.linalg.solve(v, system.B.astype(complex))


def _resolvent(T: NDArray, b: NDArray, z: NDArray) -> Complexes:
    """(zI − T)⁻¹ b for upper triangular T at every z, (n, u, k)."""
    n, u = b.shape
    x = np.zeros((n, u, len(z)), complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        for i in range(n - 1, -1, -1):
            right = b[i, :, None] + np.tensordot(T[i, i + 1 :], x[i + 1 :], axes=1)
            x[i] = right / (z - T[i, i])
    return x
