"""A small deck and a test of it, for examples, notebooks and user-written tests."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

CANTILEVER = """SOL 103
CEND
SPC = 1
METHOD = 1
BEGIN BULK
$ a steel cantilever of two halves, one metre long, with a mass at its end; units m, kg, s
EIGRL   1                       6
GRID    1               0.0     0.0     0.0
GRID    2               0.25    0.0     0.0
GRID    3               0.5     0.0     0.0
GRID    4               0.75    0.0     0.0
GRID    5               1.0     0.0     0.0
MAT1    1       2.1+11          0.3     7850.
PBAR    1       1       1.0-3   2.0-7   5.0-7   4.0-7
PBAR    2       1       1.0-3   2.0-7   5.0-7   4.0-7
CBAR    1       1       1       2       0.0     1.0     0.0
CBAR    2       1       2       3       0.0     1.0     0.0
CBAR    3       2       3       4       0.0     1.0     0.0
CBAR    4       2       4       5       0.0     1.0     0.0
CONM2   9       5               2.0
SPC1    1       123456  1
ENDDATA
"""
TRUTH = {"PBAR 1 I1": 1.8e-7, "PBAR 2 I1": 2.3e-7}
"""Second moments of area, in m⁴, of the structure that the example test measures."""


def example_deck(folder: Path | str = ".") -> Path:
    """Write ``cantilever.bdf`` into a folder and return its path: a clamped beam of four elements, units m-kg-s.

    Examples
    --------
    >>> example_deck().name
    'cantilever.bdf'
    """
    path = Path(folder) / "cantilever.bdf"
    path.write_text(CANTILEVER, encoding="utf-8")
    return path


def example_test(folder: Path | str = ".", *, frequency_scatter: float = 0.0, shape_scatter: float = 0.0) -> Path:
    """Write ``cantilever.uff`` into a folder and return its path: four modes of the cantilever with `TRUTH` in it.

    The sensors are at points 2 to 5, in Y and Z; the random errors are those of `femtune.simulate`.

    Examples
    --------
    >>> example_test().name
    'cantilever.uff'
    """
    # the checks of elements and residuals need no files
    from femtune.steps.files import write_deck, write_test  # noqa: PLC0415
    from femtune.steps.modes.simulate import simulate  # noqa: PLC0415

    with TemporaryDirectory() as apart:
        true = write_deck(example_deck(apart), TRUTH, Path(apart) / "true.bdf", wide=True)
        test = simulate(
            true, ["2 THRU 5:23"], units="m-kg-s", count=4,
            frequency_scatter=frequency_scatter, shape_scatter=shape_scatter,
        )  # fmt: skip
    return write_test(test, Path(folder) / "cantilever.uff")
