"""What has to be kept of a training so that it goes on where it stopped."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.model.reduce.trained import Certified, Trained

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SavedBasis:
    """Plain arrays of a `Trained`.

    Parameters
    ----------
    shift : σ of the nominal model
    basis : V (n_free, r)
    x : (p, k) certified points
    eigenvalues : (p, m) there, NaN where a point has fewer
    known : (p, 3) estimate, true error and order of each
    points, estimates : (c, k) candidates and (c,) their estimates
    """

    shift: float
    basis: Reals
    x: Reals
    eigenvalues: Reals
    known: Reals
    points: Reals
    estimates: Reals

    @classmethod
    def of(cls, trained: Trained) -> SavedBasis:
        """The arrays of a training."""
        some = trained.certified
        values = np.full((len(some), max(len(c.eigenvalues) for c in some)), np.nan)
        for row, c in zip(values, some):
            row[: len(c.eigenvalues)] = c.eigenvalues
        known = np.array([(c.estimate, c.error, c.order) for c in some], float)
        x = np.array([c.x for c in some], float)
        return cls(trained.model.shift, trained.basis, x, values, known, trained.points, trained.estimates)

    def check(self) -> None:
        """Refuse shapes that do not belong together.

        Raises
        ------
        ValueError : in words
        """
        p, k = self.x.shape
        fits = self.basis.ndim == 2 and self.eigenvalues.shape[:1] == (p,) and self.known.shape == (p, 3)
        fits = fits and self.points.ndim == 2 and self.points.shape[1] == k
        fits = fits and self.estimates.shape == (len(self.points),)
        if not fits or p == 0 or not np.isfinite(self.basis).all() or not self.shift < 0.0:
            raise ValueError("its arrays do not fit together")

    def certified(self) -> tuple[Certified, ...]:
        """The points where the full model was solved."""
        rows = zip(self.x, self.eigenvalues, self.known)
        return tuple(Certified(x, v[np.isfinite(v)], float(e), float(t), int(n)) for x, v, (e, t, n) in rows)
