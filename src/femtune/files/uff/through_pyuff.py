"""One data set at a time through pyuff, whose errors become ours.

pyuff is used for 15, 18, 58, 58b, 82, 164, 2411 and 2420, where its values are right once the frame of the data
set is known to be whole. It is given a clean copy (line ends, trailing blanks, D exponents), and what comes back
is counted by the callers. It is not used for 55 (it cannot hold complex rotations, shifts where a record takes
two lines, and refuses D exponents), for 2412 (elements of more than eight nodes go wrong), nor for 151.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from femtune._optional import require
from femtune.files.uff.fields import with_e_exponents
from femtune.files.uff.scan import DataSet

_VERBATIM = {18: lambda i: i % 4 == 1, 58: lambda i: i < 11 and i != 6, 82: lambda i: i == 1}
"""Lines that hold names, not numbers, by data set."""


def through_pyuff(data_set: DataSet) -> dict[str, Any]:
    """What pyuff reads from one data set.

    Raises
    ------
    FemtuneError : ``uff.unreadable`` when pyuff fails, sees another data set, or leaves keys out
    """
    pyuff = require("pyuff")
    with tempfile.TemporaryDirectory(prefix="femtune-uff-") as folder:
        path = Path(folder) / "one.uff"
        path.write_bytes(_clean_copy(data_set))
        try:
            file = pyuff.UFF(str(path))
            types = [int(number) for number in file.get_set_types()]
            values = file.read_sets(0) if types == [data_set.number] else None
        # pyuff raises bare Exception for whatever it stumbles on.
        except Exception as problem:
            raise _unreadable(data_set, str(problem)) from problem
    if not isinstance(values, dict):
        raise _unreadable(data_set, f"it sees the data sets {types} in it")
    return values


def _clean_copy(data_set: DataSet) -> bytes:
    verbatim = _VERBATIM.get(data_set.number, lambda i: False)
    lines = [text if verbatim(i) else with_e_exponents(text) for i, text in enumerate(data_set.lines)]
    text = "\n".join(["    -1", data_set.head, *lines, ""])
    return text.encode() + data_set.payload + b"    -1\n"


def _unreadable(data_set: DataSet, reason: str) -> Any:
    return data_set.error(
        "uff.unreadable",
        f"data set {data_set.number} cannot be read: {reason}",
        hint="compare the columns of its records with the definition of the format, or export it again",
    )
