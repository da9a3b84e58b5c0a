"""Time records of Universal Files: data sets 58 of function type 1, ASCII and binary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femtune.dofs import Dof
from femtune.files.records.table import RecordTable, problem
from femtune.files.uff.function_records import MeasuredFunction, dof_of, read_functions
from femtune.files.uff.scan import scan_uff

_TIME_RESPONSE, _TIME = 1, 17
_QUANTITIES = {8: "displacement", 11: "velocity", 12: "acceleration", 13: "force", 15: "pressure", 2: "strain"}


@dataclass(frozen=True)
class UffChannel:
    """What a Universal File says of one column; None for a DOF that it does not name."""

    dof: Dof | None
    quantity: str
    unit: str


def read_uff_time(path: Path) -> tuple[RecordTable, tuple[UffChannel, ...]]:
    """All time records of a file, which must share one clock.

    Raises
    ------
    FemtuneError : ``record.file`` where there are none, or where lengths or steps differ; ``uff.*``
    """
    functions, _ = read_functions(scan_uff(path))
    times = [f for f in functions if _is_time(f)]
    if not times:
        kinds = sorted({f.header.function_type for f in functions})
        hint = "export the time histories as data sets 58 of function type 1"
        raise problem(path, "record.file", "the file has no time records", hint, function_types=kinds)
    _check_clock(path, times)
    first = times[0]
    channels = tuple(_channel(f) for f in times)
    names = tuple(str(c.dof or "") for c in channels)
    rate = 1.0 / first.header.step if first.header.even and first.header.step > 0.0 else None
    table = RecordTable(np.array([f.values for f in times]), names, rate, None if rate else first.x, str(path))
    return table, channels


def _is_time(function: MeasuredFunction) -> bool:
    header = function.header
    return (
        header.function_type == _TIME_RESPONSE
        and header.kinds[0] in (0, _TIME)
        and not np.iscomplexobj(function.values)
    )


def _check_clock(path: Path, times: Sequence[MeasuredFunction]) -> None:
    first = times[0]
    for other in times[1:]:
        if len(other.x) != len(first.x) or not np.allclose(other.x, first.x, rtol=1e-6, atol=0.0):
            what = "the time records of the file differ in length or step"
            one, two = f"{len(first.x)} samples", f"{len(other.x)} samples at {other.where}"
            raise problem(
                path, "record.file", what, "export records of one measurement into one file", first=one, other=two
            )


def _channel(function: MeasuredFunction) -> UffChannel:
    header = function.header
    return UffChannel(dof_of(*header.response), _QUANTITIES.get(header.kinds[1], "unknown"), header.unit_labels[1])
