"""Errors of the sensor positions, as records."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.residuals.shape import placement_covariance

if TYPE_CHECKING:
    from femtune.correlation import Correlation, Pair
    from femtune.model import EigenSolution
    from femtune.study.cases import StudyCase
from femtune.steps.correlate.record.placement import PlacementOfMode, PlacementResults


def placement_results(case: StudyCase, c: Correlation, solution: EigenSolution) -> PlacementResults | None:
    """The record; None where the study states no errors of the placement."""
    placement = case.placement
    if placement is None or case.modal is None:
        return None
    shapes = case.modal.test.shapes
    measured = [p for p in c.pairing.pairs if np.nan_to_num(shapes[:, p.test]).any()]
    angles = np.degrees(placement.angle_sd)
    return PlacementResults(
        position_sd=(float(placement.position_sd.min()), float(placement.position_sd.max())),
        angle_sd_deg=(float(angles.min()), float(angles.max())),
        modes=tuple(_mode(case, c, solution, pair) for pair in measured),
    )


def _mode(case: StudyCase, c: Correlation, solution: EigenSolution, pair: Pair) -> PlacementOfMode:
    assert case.modal is not None
    assert case.placement is not None
    members = (pair.model,) if pair.cluster is None else c.clusters[pair.cluster].model
    test = case.modal.test.shapes[:, pair.test]
    covariance = placement_covariance(case.placement, solution, case.modal, members, test)
    known = ~np.isnan(test)
    psi, P = test[known], covariance[np.ix_(known, known)]
    sd = np.sqrt(np.diag(P)) / np.abs(psi).max()
    size = float(psi @ psi)
    # the part of the errors that is orthogonal to the shape lowers the MAC
    loss = float(np.trace(P) - psi @ P @ psi / size) / size
    worst = int(np.argmax(sd))
    return PlacementOfMode(
        test_label=case.modal.test.labels[pair.test],
        sd_percent=100.0 * float(np.sqrt(np.mean(sd**2))),
        largest_percent=100.0 * float(sd[worst]),
        largest_dof=str(case.modal.test.dofs[int(np.flatnonzero(known)[worst])]),
        mac_loss=loss / (1.0 + loss),
    )
