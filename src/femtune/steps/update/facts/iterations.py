"""Compared FRFs at each iteration, as records and arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.steps.respond.identified_frfs import identified_frfs
from femtune.steps.update.record.iterations import IterationFrfs
from femtune.units import frf_unit

if TYPE_CHECKING:
    from femtune.residuals.frf.fitted import FittedFrfs
    from femtune.testdata import ModalTest
    from femtune.units import UnitSystem
    from femtune.updating import Iteration


MOST_VALUES = 4_000_000
"""Values of the model in all iterations of one record (32 MB); if there are more, only some of the outputs are kept."""


def iteration_frfs(
    history: Sequence[Iteration],
    units: UnitSystem | None,
    arrays: dict[str, NDArray],
    identified: Mapping[str, ModalTest],
) -> tuple[IterationFrfs, ...]:
    """A record for each set of functions that is compared somewhere in the history; none without FRF residuals.

    Functions are the same set where configuration, channels and lines agree, also in another search or stage.

    Parameters
    ----------
    units : of the functions; None where they are not known
    arrays : gets the lines and the values
    identified : tests by configuration, whose identified modes are shown with the measured functions
    """
    sets: dict[tuple, list[tuple[int, FittedFrfs]]] = {}
    for number, iteration in enumerate(history):
        for functions in iteration.functions:
            sets.setdefault(_key(functions), []).append((number, functions))
    records = (_record(i, functions, len(history), arrays) for i, functions in enumerate(sets.values(), 1))
    whole = [_with_identified(r, identified.get(r.configuration), arrays) for r in records]
    return tuple(r if units is None else r.model_copy(update={"unit": frf_unit(r.kind, units)}) for r in whole)


def _key(fitted: FittedFrfs) -> tuple:
    measured = fitted.measured
    channels = tuple(measured.responses.labels()), tuple(measured.references.labels())
    return fitted.configuration, measured.kind, fitted.phase, *channels, measured.freq_hz.tobytes()


def _record(
    number: int, fitted: Sequence[tuple[int, FittedFrfs]], iterations: int, arrays: dict[str, NDArray]
) -> IterationFrfs:
    last = fitted[-1][1]
    measured, rows = last.measured, _kept(last.values.shape, iterations)
    values = np.full((iterations, len(rows), *last.values.shape[1:]), np.nan, np.complex64)
    for at, one in fitted:
        values[at] = one.values[rows]
    compared = np.isfinite(last.values[rows])
    prefix = f"update/frf_{number}"
    arrays |= {
        f"{prefix}_hz": measured.freq_hz,
        f"{prefix}_values": values,
        f"{prefix}_test_values": np.where(compared, measured.values[rows], np.nan).astype(np.complex64),
    }
    outputs = measured.responses.labels()
    return IterationFrfs(
        configuration=last.configuration,
        kind=measured.kind,  # type: ignore[arg-type]
        phase=last.phase,
        outputs=tuple(outputs[i] for i in rows),
        inputs=tuple(measured.references.labels()),
        freq_key=f"{prefix}_hz",
        values_key=f"{prefix}_values",
        test_values_key=f"{prefix}_test_values",
    )


def _with_identified(record: IterationFrfs, test: ModalTest | None, arrays: dict[str, NDArray]) -> IterationFrfs:
    """With the FRFs of the identified modes, where the test has modes."""
    identified = None if test is None or test.frfs is None else identified_frfs(test.frfs, test.modes)
    if test is None or test.frfs is None or identified is None:
        return record
    rows, columns = DofSet.parse(record.outputs), DofSet.parse(record.inputs)
    at = np.ix_(rows.align(test.frfs.responses)[0], columns.align(test.frfs.references)[0])
    prefix = record.freq_key.removesuffix("_hz")
    arrays |= {
        f"{prefix}_identified_hz": identified[0],
        f"{prefix}_identified_values": identified[1][at].astype(np.complex64),
    }
    keys = {"identified_freq_key": f"{prefix}_identified_hz", "identified_values_key": f"{prefix}_identified_values"}
    return record.model_copy(update=keys)


def _kept(shape: tuple[int, ...], iterations: int) -> list[int]:
    """Rows of the outputs that are kept, evenly spaced where these are not all."""
    most = max(1, MOST_VALUES // max(1, iterations * int(np.prod(shape[1:]))))
    return sorted(set(np.linspace(0, shape[0] - 1, min(most, shape[0])).round().astype(int).tolist()))
