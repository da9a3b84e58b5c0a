"""How the FRFs of a test are identified, as the study asks for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.errors import FemtuneError
from femtune.identification import InputKnown

if TYPE_CHECKING:
    from femtune.files.study_file import StudyFile
    from femtune.modal import ModeSet
    from femtune.testdata import ModalTest


def identification_of(file: StudyFile, test: ModalTest, rigid: ModeSet | None = None) -> InputKnown:
    """Options of [equalise] and of the test; those of the test alone without [equalise].

    Parameters
    ----------
    rigid : rigid-body modes of the model at the channels of the test, where the study takes them away
    """
    table = file.equalise
    if table is None:
        return InputKnown(exponential_s=test.exponential_s, raised=True)
    return InputKnown(
        table.band_hz, table.largest_order or InputKnown.largest_order, take=table.take_hz, drop=table.drop_hz,
        rigid=rigid, exponential_s=test.exponential_s, suspension_hz=table.suspension_hz or 0.0, order=table.order,
        raised=table.largest_order is None,
    )  # fmt: skip


def window_of_test(file: StudyFile, configuration: str, test: ModalTest) -> float | None:
    """Time constant of the exponential window of a test's FRFs, by [equalise] or by the file of the test.

    Raises
    ------
    FemtuneError : ``residual.window-differs``
    """
    stated = None if file.equalise is None else file.equalise.exponential_s
    if stated is None or test.frfs is None:
        return test.exponential_s
    if test.exponential_s is not None and abs(test.exponential_s - stated) > _SAME * stated:
        raise FemtuneError(
            "residual.window-differs", where=file.where("equalise", "exponential_s"), configuration=configuration,
            stated=stated, of_test=test.exponential_s,
        )  # fmt: skip
    return stated


_SAME = 1e-6
"""Relative difference of two time constants that were rounded."""
