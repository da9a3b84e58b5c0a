"""Vibration of a modal model: base and force excitation by sine sweeps, random vibration and transients."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.model.vibration.random import Spectrum, response_density, response_rms
    from femtune.model.vibration.sweep import Sweep, swept_response, transient_response
    from femtune.model.vibration.transfer import (
        ModalTransfer,
        ModesOnBase,
        base_transfer,
        force_transfer,
        transfer_of_base,
    )
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "ModalTransfer",
    "ModesOnBase",
    "Spectrum",
    "Sweep",
    "base_transfer",
    "force_transfer",
    "response_density",
    "response_rms",
    "swept_response",
    "transfer_of_base",
    "transient_response",
]
