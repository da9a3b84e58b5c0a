"""A matrix that a file does not hold."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from femtune.errors import FemtuneError, Where, did_you_mean


def no_such_matrix(path: Path, name: str | None, known: Sequence[str]) -> FemtuneError:
    """The file does not hold the matrix that was asked for."""
    return FemtuneError(
        "matrices.no-such-matrix",
        f"the file holds no matrix '{name}'" if name else "the file holds no matrix",
        where=Where(str(path)),
        values={"matrices": ", ".join(known[:20]) or "none"},
        hint=did_you_mean(name, known) if name else "check that the solver wrote it to the end",
    )
