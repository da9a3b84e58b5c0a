"""Data of a study that occur twice: used by the update and kept for validation, or counted twice by the update."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.numbers import counted, listed
from femtune.errors import ErrorCollector, FemtuneError
from femtune.judge.independence import shared_functions, shared_modes
from femtune.steps.validate.facts import judged_tests
from femtune.steps.validate.frf_validation import used_functions
from femtune.study.error_places import place_of
from femtune.study.record import Alert, alert
from femtune.study.same_test import enough, same_file

if TYPE_CHECKING:
    from femtune.modal import FrfSet
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study


def check_independent(study: Study) -> None:
    """Refuse configurations for validation with data that the update uses.

    Raises
    ------
    FemtuneError : ``study.validation-used``, of each such configuration
    """
    errors = ErrorCollector()
    for case in study.cases:
        if case.entry.use != "validation" or case.test is None:
            continue
        for other in study.cases:
            shared = _shared(study, other, case, judged_tests(case), case.test.frfs)
            if shared.words:
                errors.errors.append(
                    FemtuneError(
                        "study.validation-used", where=place_of(study.file, case.entry, "test"),
                        configuration=case.name, used=other.name, shared=shared.words,
                    )
                )  # fmt: skip
    errors.raise_if_any()


def counted_twice(study: Study) -> Iterator[Alert]:
    """Alerts on configurations of the update that contain the same data."""
    used = [case for case in study.cases if case.used is not None]
    for first, second in combinations(used, 2):
        if first.entry.specimen != second.entry.specimen:
            continue
        shared = _shared(study, first, second, _used_modes(second), _used_frfs(study, second))
        if shared.words:
            yield alert(
                "warning", "study.test-counted-twice", first=first.name, second=second.name, shared=shared.words
            )  # fmt: skip


@dataclass(frozen=True)
class _Shared:
    """Labels of the modes, and number of the FRFs, that two configurations have in common."""

    modes: tuple[str, ...]
    functions: int

    @property
    def words(self) -> str:
        """What is shared; "" for nothing."""
        modes = [f"{'mode' if len(self.modes) == 1 else 'modes'} {listed(self.modes)}"] if self.modes else []
        return " and ".join([*modes, *([counted(self.functions, "FRF")] if self.functions else [])])


def _shared(study: Study, used: StudyCase, other: StudyCase, positions: Iterable[int], frfs: FrfSet | None) -> _Shared:
    """What the update uses of one configuration and another one has too: its modes at `positions`, and `frfs`."""
    used_modes, asked, labels = set(_used_modes(used)), set(positions), tuple[str, ...]()
    if used.modal is not None and other.modal is not None and used.used is not None and asked:
        # without the channels that are held out
        modes = shared_modes(used.used.test, other.modal.test)
        same = {j for i, j in modes.pairs if i in used_modes and j in asked}
        if modes.by_shape and same and (same_file(used, other) or enough(len(same), len(asked))):
            labels = tuple(other.modal.test.labels[j] for j in sorted(same))
    mine = _used_frfs(study, used)
    functions = shared_functions(mine, frfs) if mine is not None and frfs is not None else ()
    return _Shared(labels, len(functions))


def _used_modes(case: StudyCase) -> list[int]:
    """Positions of the test modes that residuals of the update compare."""
    if case.modal is None or case.used is None or not any(r.of_modes for r in case.used.residuals):
        return []
    return sorted(set(range(len(case.modal.test))) - set(case.used.left_out))


def _used_frfs(study: Study, case: StudyCase) -> FrfSet | None:
    """The FRFs that residuals of the update compare, NaN elsewhere."""
    if case.test is None or case.test.frfs is None or case.used is None:
        return None
    used, frfs = used_functions(study, case), case.test.frfs
    return replace(frfs, values=np.where(used[:, :, None], frfs.values, np.nan)) if used.any() else None
