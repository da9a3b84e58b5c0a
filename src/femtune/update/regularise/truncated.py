"""Truncated singular values: combinations that the data hardly feel hold still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.update.regularise.side import LinearModel, SideConstraint


@dataclass(frozen=True)
class Truncated:
    """Every step leaves out the combinations whose singular value is below `threshold` times the largest.

    Singular values are those of the first Jacobian by parameters in units of their prior standard deviations. The
    combinations found there are kept: otherwise they would turn as the iteration goes on, and steps that are each
    truncated could together go anywhere.
    """

    threshold: float

    def settle(self, at: LinearModel) -> SideConstraint:
        """No rows, but the combinations that hold still."""
        spread = at.parameters.prior[1][at.moving]
        scaled = at.jacobian[:, at.moving] * spread
        _, s, vt = np.linalg.svd(scaled, full_matrices=len(scaled) < scaled.shape[1])
        s = np.concatenate([s, np.zeros(len(vt) - len(s))])
        small = vt[s <= self.threshold * s.max(initial=0.0)] / spread
        held = np.zeros((len(small), len(at.x)))
        held[:, at.moving] = small / np.linalg.norm(small, axis=1, keepdims=True)
        return SideConstraint("truncated", np.zeros((0, len(at.x))), held=held)
