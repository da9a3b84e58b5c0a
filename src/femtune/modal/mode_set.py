"""ModeSet: the modes of a test or of a model."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError

NORMALISATIONS = ("mass", "unit-norm", "unit-max", "unknown")


@dataclass(frozen=True, eq=False, repr=False)
class ModeSet:
    """Natural modes at a set of DOFs; its arrays are read-only.

    Parameters
    ----------
    freq_hz : (m,) natural frequencies
    shapes : (n, m) real or complex; NaN marks an entry that was not measured
    dofs : the n DOFs of the rows
    labels : m names; "1", "2", … unless the source has labels
    damping_ratio : (m,) fractions of critical, or None if unknown
    normalisation : one of NORMALISATIONS
    freq_sd_hz : (m,) standard deviations of the frequencies, or None
    shapes_sd : (n, m) standard deviations of the entries, or None; of a complex entry √E|error|²
    source : origin of the modes, a text
    damping_sd : (m,) standard deviations of the damping ratios, or None
    covariance : (2m, 2m) of the m frequencies in Hz and, after them, the m damping ratios, or None; its diagonal has
        the squares of the standard deviations if these are given too
    modal_a : (m,) complex scale of modes with known input, or None: receptance = Σ ψψᵀ/(a(iω−λ)) and conjugates, so
        a = 2iω_d if ψ is real and mass-normalised

    Raises
    ------
    FemtuneError : ``modes.shape`` if the sizes disagree, ``modes.normalisation`` for a word that is not one of
        NORMALISATIONS, ``modes.values`` for negative or infinite standard deviations, frequencies that are
        negative or not finite, infinite entries of shapes, a covariance that is not symmetric or contradicts the
        standard deviations, a scale of zero

    Examples
    --------
    >>> import numpy as np
    >>> import femtune as ft
    >>> ft.ModeSet(np.array([12.5]), np.array([[1.0], [0.4]]), ft.DofSet.parse(["3Z+", "2Z+"]))
    ModeSet: 1 mode at 2 DOFs, 12.5 Hz, normalisation unknown
    """

    freq_hz: NDArray[np.float64]
    shapes: NDArray
    dofs: DofSet
    labels: tuple[str, ...] = ()
    damping_ratio: NDArray[np.float64] | None = None
    normalisation: str = "unknown"
    freq_sd_hz: NDArray[np.float64] | None = None
    shapes_sd: NDArray[np.float64] | None = None
    source: str = ""
    damping_sd: NDArray[np.float64] | None = None
    covariance: NDArray[np.float64] | None = None
    modal_a: NDArray[np.complex128] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.dofs, DofSet):
            facts: dict[str, Any] = {
                "name": "dofs",
                "function": "ModeSet",
                "allowed": "DofSet",
                "given": type(self.dofs).__name__,
            }
            raise FemtuneError("call.argument", values={"dofs": repr(self.dofs)[:80]}, **facts)
        for name in ("freq_hz", "damping_ratio", "freq_sd_hz", "shapes_sd", "damping_sd", "covariance"):
            object.__setattr__(self, name, read_only(getattr(self, name), float))
        object.__setattr__(self, "shapes", read_only(self.shapes))
        object.__setattr__(self, "modal_a", read_only(self.modal_a, complex))
        if not self.labels:
            object.__setattr__(self, "labels", tuple(str(i + 1) for i in range(np.size(self.freq_hz))))
        self._check_sizes()
        self._check_values()

    def _check_sizes(self) -> None:
        n, m = len(self.dofs), np.size(self.freq_hz)
        wanted: dict[str, tuple[Any, tuple[int, ...]]] = {
            "freq_hz": (self.freq_hz, (m,)),
            "shapes": (self.shapes, (n, m)),
            "labels": (self.labels, (m,)),
            "damping_ratio": (self.damping_ratio, (m,)),
            "freq_sd_hz": (self.freq_sd_hz, (m,)),
            "shapes_sd": (self.shapes_sd, (n, m)),
            "damping_sd": (self.damping_sd, (m,)),
            "covariance": (self.covariance, (2 * m, 2 * m)),
            "modal_a": (self.modal_a, (m,)),
        }
        for name, (value, shape) in wanted.items():
            if value is not None and np.shape(value) != shape:
                raise FemtuneError(
                    "modes.shape", values={"dofs": n, "modes": m}, name=name, shape=np.shape(value), expected=shape
                )
        if self.normalisation not in NORMALISATIONS:
            raise FemtuneError(
                "modes.normalisation", normalisation=self.normalisation, normalisations=", ".join(NORMALISATIONS)
            )

    def _check_values(self) -> None:
        bad = ~np.isfinite(self.freq_hz) | (self.freq_hz < 0)
        if bad.any():
            raise FemtuneError(
                "modes.values", values={self.labels[i]: self.freq_hz[i] for i in np.flatnonzero(bad)[:5]}
            )
        if np.isinf(self.shapes).any():
            raise FemtuneError("modes.values/infinite-shape")
        for name in ("freq_sd_hz", "damping_sd", "shapes_sd"):
            # NaN is an unknown standard deviation
            sd = getattr(self, name)
            if sd is not None and (np.isinf(sd) | (sd < 0)).any():
                raise FemtuneError("modes.values/standard-deviation", name=name)
        if self.modal_a is not None and ((self.modal_a == 0) | np.isinf(self.modal_a)).any():
            raise FemtuneError("modes.values/modal-scale")
        if self.covariance is not None:
            self._check_covariance(self.covariance)

    def _check_covariance(self, covariance: NDArray[np.float64]) -> None:
        if not np.allclose(covariance, covariance.T, rtol=1e-8, atol=0.0, equal_nan=True):
            raise FemtuneError("modes.values/covariance-not-symmetric")
        variances = np.split(np.diag(covariance), 2)
        for name, variance in zip(("freq_sd_hz", "damping_sd"), variances):
            sd = getattr(self, name)
            if sd is not None and not np.allclose(variance, sd**2, rtol=1e-6, atol=0.0, equal_nan=True):
                raise FemtuneError("modes.values/covariance-diagonal", name=name)

    def __repr__(self) -> str:
        m = len(self)
        span = f", {self.freq_hz[0]:.5g}" if m else ""
        span += f" to {self.freq_hz[-1]:.5g} Hz" if m > 1 else " Hz" * m
        words = f", {self.source}" if self.source else ""
        modes = "1 mode" if m == 1 else f"{m} modes"
        return f"ModeSet: {modes} at {len(self.dofs)} DOFs{span}, normalisation {self.normalisation}{words}"

    def __len__(self) -> int:
        return len(self.freq_hz)

    @property
    def omega_rad_s(self) -> NDArray[np.float64]:
        """Circular frequencies."""
        return 2.0 * np.pi * self.freq_hz

    @property
    def eigenvalues(self) -> NDArray[np.float64]:
        """λ = ω²."""
        return self.omega_rad_s**2

    def select_modes(self, keep: Iterable[int]) -> ModeSet:
        """The modes at the given positions, in that order, or those for which a mask is true."""
        at = _positions(keep)
        return replace(
            self,
            freq_hz=self.freq_hz[at],
            shapes=self.shapes[:, at],
            labels=tuple(self.labels[i] for i in at),
            damping_ratio=_columns(self.damping_ratio, at),
            freq_sd_hz=_columns(self.freq_sd_hz, at),
            shapes_sd=_columns(self.shapes_sd, at),
            damping_sd=_columns(self.damping_sd, at),
            covariance=_both(self.covariance, at, len(self)),
            modal_a=_columns(self.modal_a, at),
        )

    def select_dofs(self, dofs: DofSet) -> ModeSet:
        """The rows of `dofs`, in their order and with their signs (error ``dof.missing``)."""
        at, signs = dofs.align(self.dofs)
        sd = None if self.shapes_sd is None else self.shapes_sd[at]
        return replace(self, shapes=signs[:, None] * self.shapes[at], dofs=dofs, shapes_sd=sd)


def read_only(values: Any, dtype: type | None = None) -> Any:
    """A read-only view of `values` as an array (None stays None); nothing is copied."""
    if values is None:
        return None
    view = np.asarray(values, dtype=dtype).view()
    view.flags.writeable = False
    return view


def _positions(keep: Iterable[int]) -> list[int]:
    at = np.asarray(list(keep))
    return [int(i) for i in (np.flatnonzero(at) if at.dtype == bool else at)]


def _columns(values: NDArray | None, at: list[int]) -> NDArray | None:
    return None if values is None else values[..., at]


def _both(covariance: NDArray | None, at: list[int], m: int) -> NDArray | None:
    every = [*at, *(i + m for i in at)]
    return None if covariance is None else covariance[np.ix_(every, every)]
