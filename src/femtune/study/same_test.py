"""Whether configurations of a study have one test: the same file, or a copy of it or of a part."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femtune.files.study_file import test_files
from femtune.judge.independence import shared_modes

if TYPE_CHECKING:
    from femtune.study.cases import StudyCase

_SHARE = 0.5
"""Share of the modes of a test that must be those of another file for both to be one test. A few modes may be the same
in two states of a structure, if what differs does not move in them, and simulated tests have no scatter."""


def is_same_test(case: StudyCase, others: Iterable[StudyCase]) -> bool:
    """True if another configuration has a test with the same file, or with the same modes."""
    return any(same_file(case, o) or _is_copy(case, o) for o in others if o.name != case.name)


def same_file(a: StudyCase, b: StudyCase) -> bool:
    """True if the tests of both are the same records of the same files."""
    if a.entry.test is None or b.entry.test is None:
        return False
    return (test_files(a.entry), a.entry.records) == (test_files(b.entry), b.entry.records)


def enough(same: int, of: int) -> bool:
    """True if so many of so many modes show that two tests are one: all, or two and at least half of them."""
    return same == of or (same > 1 and same >= _SHARE * of)


def _is_copy(a: StudyCase, b: StudyCase) -> bool:
    if a.modal is None or b.modal is None:
        return False
    same = shared_modes(a.modal.test, b.modal.test).pairs
    return bool(same) and enough(len(same), min(len(a.modal.test), len(b.modal.test)))
