"""A model small enough to be solved in a page while a reader moves its parameters."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.model.live.basis import SecondBasis, second_basis
    from femtune.model.live.chebyshev import ChebyshevFunctions, Separated, separated_terms
    from femtune.model.live.frfs import LiveDamping, LivePorts
    from femtune.model.live.matrices import LiveModel, LiveModes, LiveTerm, live_model
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "ChebyshevFunctions",
    "LiveDamping",
    "LiveModel",
    "LiveModes",
    "LivePorts",
    "LiveTerm",
    "SecondBasis",
    "Separated",
    "live_model",
    "second_basis",
    "separated_terms",
]
