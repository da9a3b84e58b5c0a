"""Why a test mode found no partner, in words."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from femtune.correlate.candidates import Candidates
from femtune.errors import FemtuneError
from femtune.modal import ModeSet


def reason_unpaired(
    i: int,
    test: ModeSet,
    model: ModeSet,
    found: Candidates,
    chosen: Mapping[int, int],
    refused: Mapping[int, float],
    gates: tuple[float, float],
) -> str:
    """Best candidate of a test mode, its MAC and frequency error, and what spoke against it.

    `refused` holds MACs after rotation of test modes that a cluster gave back; `gates` are (frequency, MAC).
    """
    if not np.isfinite(found.score[i]).any():
        return "no model mode moves where this mode was measured"
    j = _best(i, found, gates)
    head = (
        f"best candidate is {_named(j, model, found)} ({model.freq_hz[j]:.4g} Hz): "
        f"MAC {found.score[i, j]:.2f}, frequency error {100 * found.frequency_error[i, j]:+.1f} %"
    )
    return f"{head}; {_obstacle(i, j, test, model, found, chosen, refused, gates)}"


def _named(j: int, model: ModeSet, found: Candidates) -> str:
    group = _companions(j, found)
    names = ", ".join(model.labels[k] for k in group)
    return f"model mode {names}" if len(group) == 1 else f"the cluster of model modes {names}"


def _best(i: int, found: Candidates, gates: tuple[float, float]) -> int:
    """The candidate with the largest MAC among those that pass both gates, else among all."""
    score = np.nan_to_num(found.score[i], nan=-1.0)
    passes = (np.abs(found.frequency_error[i]) <= gates[0]) & (score >= gates[1])
    return int(np.argmax(score + 2.0 * passes))


def _obstacle(
    i: int,
    j: int,
    test: ModeSet,
    model: ModeSet,
    found: Candidates,
    chosen: Mapping[int, int],
    refused: Mapping[int, float],
    gates: tuple[float, float],
) -> str:
    failed = []
    if abs(found.frequency_error[i, j]) > gates[0]:
        failed.append(f"the frequency gate of {100 * gates[0]:.3g} % fails")
    if not found.score[i, j] >= gates[1]:
        failed.append(f"the MAC gate of {gates[1]:.2f} fails")
    if failed:
        return " and ".join(failed)
    if i in refused:
        return f"within its cluster of close modes the MAC after rotation is {refused[i]:.2f}, the gate {gates[1]:.2f}"
    return _taken(j, test, found, chosen)


def _taken(j: int, test: ModeSet, found: Candidates, chosen: Mapping[int, int]) -> str:
    holders = [test.labels[i] for i, k in chosen.items() if k in _companions(j, found)]
    return (
        f"it is taken by test mode {', '.join(holders)}" if holders else "the assignment as a whole is better without"
    )


def _companions(j: int, found: Candidates) -> tuple[int, ...]:
    """The cluster of a model mode, itself included."""
    return next((group for group in found.groups if j in group), (j,))


def no_pairs(test: ModeSet, reasons: Mapping[int, str], source: str = "") -> FemtuneError:
    """The error ``correlate.no-pairs`` for a caller that cannot go on without pairs.

    Parameters
    ----------
    reasons : why each test mode is unpaired, by position
    source : which test, for the message
    """
    shown = list(reasons.items())[:8]
    values = {f"test mode {test.labels[i]} ({test.freq_hz[i]:.4g} Hz)": reason for i, reason in shown}
    if len(reasons) > len(shown):
        values["…"] = f"and {len(reasons) - len(shown)} more"
    return FemtuneError(
        "correlate.no-pairs",
        f"none of the {len(test)} test modes{' of ' + source if source else ''} could be paired with a model mode",
        values=values,
        hint="check units, axes and sensor directions; then try more model modes, wider gates or pairs fixed by hand",
    )
