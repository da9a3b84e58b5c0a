"""The method of an update from the keys of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.updating import SensitivityMethod, StartRules
from femtune.updating.asked import regularisation_of
from femtune.updating.kinds import SEARCH_METHODS

if TYPE_CHECKING:
    from femtune.files.study_file.update import UpdateTable
    from femtune.parameters import ParameterSet


def method_of(table: UpdateTable, parameters: ParameterSet) -> SensitivityMethod:
    """The method that [update] asks for (errors ``prior.*``)."""
    regularisation = regularisation_of(table, parameters)
    search = SEARCH_METHODS[table.search].load()()
    return SensitivityMethod(
        table.max_iterations, table.tolerance, regularisation, search, table.adapt, table.smallest_change
    )


def start_rules(table: UpdateTable) -> StartRules:
    """The starts that [update] asks for."""
    return StartRules(table.starts, table.seed, table.hops, table.samples)
