"""Tables of numbers that steps write for other programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Where
from femtune.files.whole_file import write_whole


def write_csv(path: Path, heads: Sequence[str], table: Reals) -> None:
    """The table of runs, with a line of names; nothing where a run failed (error ``run.unwritable``)."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heads)
    writer.writerows(["" if np.isnan(v) else repr(float(v)) for v in row] for row in table)
    try:
        write_whole(path, text.getvalue().encode())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FemtuneError("run.unwritable/table", where=Where(str(path)), reason=reason) from error
