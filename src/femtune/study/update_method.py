"""The method of an update from the words of a study."""

from __future__ import annotations

from femtune.files.study_file.steps import UpdateTable
from femtune.update import MinimumChange, NoRegularisation, Prior, Regularisation


def regularisation_of(table: UpdateTable) -> Regularisation:
    """The side constraint that [update] asks for."""
    if table.regularisation == "minimum-change":
        return MinimumChange(table.weight)
    return Prior() if table.regularisation == "prior" else NoRegularisation()
