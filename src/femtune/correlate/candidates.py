"""What a pairing chooses from: scores and frequency errors of every test mode with every model mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.modal import ModeSet, clusters
from femtune.modal.mac import check_shapes, mac_where_defined
from femtune.modal.subspace import projection

Reals = NDArray[np.float64]

INVISIBLE = 1e-6
"""A model mode that moves the sensors less than this fraction of the most visible mode cannot be seen there."""


@dataclass(frozen=True)
class Candidates:
    """Scores before anything is paired.

    Parameters
    ----------
    score : (t, m) MAC, for members of a cluster the share of the test shape in the cluster's subspace; NaN where
        undefined
    frequency_error : (t, m) (model − test)/test
    groups : clusters of two or more close model modes, by position
    """

    score: Reals
    frequency_error: Reals
    groups: tuple[tuple[int, ...], ...]
    visible: NDArray[np.bool_]
    notices: tuple[Notice, ...]


def candidates(test: ModeSet, model: ModeSet, relative_gap: float) -> Candidates:
    """Compare every test mode with every model mode (errors ``correlate.dofs-differ``, ``modal.zero-shape``)."""
    _check_dofs(test, model)
    check_shapes(test.shapes, "the test")
    visible = visible_modes(model)
    groups, notices = _groups(model, visible, _measured_rows(test), relative_gap)
    score = mac_where_defined(test.shapes, np.where(visible, model.shapes, 0.0))
    for group in groups:
        score[:, group] = projection(model.shapes[:, group], test.shapes)[:, None]
    return Candidates(score, frequency_errors(test.freq_hz, model.freq_hz), groups, visible, notices)


def frequency_errors(test_hz: Reals, model_hz: Reals) -> Reals:
    """(model − test)/test of every combination, (t, m); infinite where the test says 0 Hz."""
    t, m = np.meshgrid(test_hz, model_hz, indexing="ij")
    return np.where(t > 0.0, m - t, np.inf) / np.where(t > 0.0, t, 1.0)


def visible_modes(model: ModeSet) -> NDArray[np.bool_]:
    """(m,) True where a mode moves the sensors; the others (torsion seen by axial sensors …) have no MAC."""
    size = np.sqrt(np.sum(np.where(np.isnan(model.shapes), 0.0, np.abs(model.shapes)) ** 2, axis=0))
    return np.asarray(size > INVISIBLE * size.max(initial=0.0))


def _check_dofs(test: ModeSet, model: ModeSet) -> None:
    if test.dofs != model.dofs:
        raise FemtuneError(
            "correlate.dofs-differ",
            "test and model modes are not given at the same DOFs in the same order",
            values={"test": f"{len(test.dofs)} DOFs", "model": f"{len(model.dofs)} DOFs"},
            hint="sample the model at the sensors with a SensorMap, then select the same DofSet from both",
        )


def _measured_rows(test: ModeSet) -> int:
    """The fewest entries that any test mode has."""
    return int(np.min(np.sum(~np.isnan(test.shapes), axis=0), initial=len(test.dofs)))


def _groups(
    model: ModeSet, visible: NDArray[np.bool_], rows: int, relative_gap: float
) -> tuple[tuple[tuple[int, ...], ...], tuple[Notice, ...]]:
    """Clusters of visible modes; one with as many modes as sensors is not used, for any shape lies in its span."""
    at = np.flatnonzero(visible)
    chains = [tuple(int(at[i]) for i in chain) for chain in clusters(model.freq_hz[at], relative_gap)]
    chains = [chain for chain in chains if len(chain) > 1]
    usable = tuple(chain for chain in chains if len(chain) < rows)
    notices = tuple(_crowded(model, chain, rows) for chain in chains if 2 * len(chain) > rows)
    return usable, notices


def _crowded(model: ModeSet, chain: tuple[int, ...], rows: int) -> Notice:
    modes = ", ".join(model.labels[i] for i in chain)
    if len(chain) >= rows:
        what = "they are compared one by one, for any shape lies in their span"
    else:
        what = f"chance alone gives a MAC of {len(chain) / rows:.2f} after their rotation"
    text = f"{len(chain)} close model modes ({modes}) stand against {rows} measured DOFs: {what}"
    return Notice("correlate.crowded-cluster", text)
