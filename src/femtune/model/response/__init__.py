"""Responses of a model: FRFs, complex modes, static response and mass properties, all with derivatives."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.model.response.basis import TIMES_HIGHEST_LINE
    from femtune.model.response.complex_derivatives import (
        ComplexModeDerivative,
        complex_mode_derivative,
        mean_pole_derivative,
    )
    from femtune.model.response.complex_eigen import ComplexModes, complex_modes
    from femtune.model.response.frf_methods import METHODS, frf
    from femtune.model.response.gradient import FrfGradient, frf_gradient
    from femtune.model.response.mass import EffectiveMass, MassResponse, effective_mass, mass_response
    from femtune.model.response.modal_damping import DampingRatios
    from femtune.model.response.own_frequency import complex_modes_at_own_frequency
    from femtune.model.response.ports import Ports, Signal, make_ports, matrix_ports
    from femtune.model.response.static import StaticResponse, static_response
    from femtune.model.response.survey import survey_functions
    from femtune.model.response.to_accuracy import ACCURACY, WithError, frf_with_error
    from femtune.model.response.zeros import Zero, ZeroFinder, zero_finder
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "ACCURACY",
    "METHODS",
    "TIMES_HIGHEST_LINE",
    "ComplexModeDerivative",
    "ComplexModes",
    "DampingRatios",
    "EffectiveMass",
    "FrfGradient",
    "MassResponse",
    "Ports",
    "Signal",
    "StaticResponse",
    "WithError",
    "Zero",
    "ZeroFinder",
    "complex_mode_derivative",
    "complex_modes",
    "complex_modes_at_own_frequency",
    "effective_mass",
    "frf",
    "frf_gradient",
    "frf_with_error",
    "make_ports",
    "mass_response",
    "matrix_ports",
    "mean_pole_derivative",
    "static_response",
    "survey_functions",
    "zero_finder",
]
