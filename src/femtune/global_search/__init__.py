"""Search of the whole box for the minimum of an objective, or the front of several, on a model or on a surrogate."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.global_search.front import Front, front_of
    from femtune.global_search.methods import GlobalMinimum, SearchRules, global_minimum
    from femtune.global_search.of_surrogate import SurrogateMinimum, surrogate_minimum
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Front",
    "GlobalMinimum",
    "SearchRules",
    "SurrogateMinimum",
    "front_of",
    "global_minimum",
    "surrogate_minimum",
]
