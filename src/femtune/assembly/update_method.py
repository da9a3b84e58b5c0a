"""The method of an update from the words of a study."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from femtune.updating import (
    Distance,
    EachStep,
    GaussNewton,
    Identical,
    LevenbergMarquardt,
    LineSearch,
    Link,
    MinimumChange,
    NoRegularisation,
    Prior,
    SensitivityMethod,
    StartRules,
    Truncated,
    correlated_prior,
)

if TYPE_CHECKING:
    from femtune.files.study_file.step_tables import UpdateTable
    from femtune.parameters import ParameterSet
    from femtune.updating import (
        Regularisation,
        Search,
    )

_SEARCHES: dict[str, Callable[[], Search]] = {
    "levenberg-marquardt": LevenbergMarquardt,
    "line-search": LineSearch,
    "gauss-newton": GaussNewton,
}


def method_of(table: UpdateTable, parameters: ParameterSet) -> SensitivityMethod:
    """The method that [update] asks for (errors ``prior.*``)."""
    regularisation = regularisation_of(table, parameters)
    search = _SEARCHES[table.search]()
    return SensitivityMethod(
        table.max_iterations, table.tolerance, regularisation, search, table.adapt, table.smallest_change
    )


def regularisation_of(table: UpdateTable, parameters: ParameterSet) -> Regularisation:
    """The side constraint that [update] asks for (errors ``prior.*``)."""
    weight = table.weight

    def acting(constraint: MinimumChange | Distance | Link) -> Regularisation:
        return EachStep(constraint) if table.weight_on == "each-step" else constraint

    makers: dict[str, Callable[[], Regularisation]] = {
        "none": NoRegularisation,
        "minimum-change": lambda: acting(MinimumChange(weight)),
        "distance": lambda: acting(Distance(weight)),
        "link": lambda: acting(Link(weight)),
        "identical": lambda: Identical(table.identical, weight),
        "truncated": lambda: Truncated(float(weight)),
        "prior": lambda: _prior(table, parameters),
    }
    return makers[table.regularisation]()


def _prior(table: UpdateTable, parameters: ParameterSet) -> Prior:
    pairs = [(c.one, c.other, c.value) for c in table.correlations]
    return correlated_prior(parameters, pairs) if pairs else Prior()


def start_rules(table: UpdateTable) -> StartRules:
    """The starts that [update] asks for."""
    return StartRules(table.starts, table.seed, table.hops, table.samples)
