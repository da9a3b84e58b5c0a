"""Responses of a model: FRFs, complex modes, static response and mass properties, all with derivatives."""

from femtune.model.response.complex_derivatives import ComplexModeDerivative, complex_mode_derivative
from femtune.model.response.complex_modes import ComplexModes, complex_modes
from femtune.model.response.effective_mass import EffectiveMass, effective_mass
from femtune.model.response.frf import frf
from femtune.model.response.gradient import FrfGradient, frf_gradient
from femtune.model.response.mass import MassResponse, mass_response
from femtune.model.response.modal_damping import DampingRatios
from femtune.model.response.ports import Ports, Signal, make_ports, matrix_ports
from femtune.model.response.request import METHODS, Kind, Method
from femtune.model.response.static import StaticResponse, static_response
from femtune.model.response.zeros import Zero, ZeroFinder, zero_finder

__all__ = [
    "METHODS",
    "ComplexModeDerivative",
    "ComplexModes",
    "DampingRatios",
    "EffectiveMass",
    "FrfGradient",
    "Kind",
    "MassResponse",
    "Method",
    "Ports",
    "Signal",
    "StaticResponse",
    "Zero",
    "ZeroFinder",
    "complex_mode_derivative",
    "complex_modes",
    "effective_mass",
    "frf",
    "frf_gradient",
    "make_ports",
    "mass_response",
    "matrix_ports",
    "static_response",
    "zero_finder",
]
