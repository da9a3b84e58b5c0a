"""Vibration tests: what was measured, where, in which units, and how good it is."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.testdata.checks import (
        RealModes,
        check_modes,
        check_test,
        mean_phase_deviation_deg,
        phase_collinearity,
        real_modes,
    )
    from femtune.testdata.convert import convert_frfs, convert_units, place, renumber
    from femtune.testdata.modal_test import NO_GEOMETRY, ModalTest, Sensor, WireFrame, sensors_at
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "NO_GEOMETRY",
    "ModalTest",
    "RealModes",
    "Sensor",
    "WireFrame",
    "check_modes",
    "check_test",
    "convert_frfs",
    "convert_units",
    "mean_phase_deviation_deg",
    "phase_collinearity",
    "place",
    "real_modes",
    "renumber",
    "sensors_at",
]
