"""Data common to test and model: modes, functions, records and systems, and criteria that compare shapes."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.modal.equalise import Equalised, equalise_damping, half_band_lines
    from femtune.modal.frf_set import FrfSet, as_kind, fdac, frac, frequency_shift
    from femtune.modal.mode_set import ModeSet
    from femtune.modal.shape_criteria import (
        auto_mac,
        comac,
        cross_orthogonality,
        enhanced_comac,
        mac,
        mac_without_each,
        modal_scale_factor,
    )
    from femtune.modal.shape_scatter import entry_deviations, largest_entries
    from femtune.modal.state_space import StateSpace, freq_and_damping, pole_of, system_modes
    from femtune.modal.subspace import Rotation, clusters, principal_angles_deg, rotate_to
    from femtune.modal.time_series import Channel, TimeSeries
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Channel",
    "Equalised",
    "FrfSet",
    "ModeSet",
    "Rotation",
    "StateSpace",
    "TimeSeries",
    "as_kind",
    "auto_mac",
    "clusters",
    "comac",
    "cross_orthogonality",
    "enhanced_comac",
    "entry_deviations",
    "equalise_damping",
    "fdac",
    "frac",
    "freq_and_damping",
    "frequency_shift",
    "half_band_lines",
    "largest_entries",
    "mac",
    "mac_without_each",
    "modal_scale_factor",
    "pole_of",
    "principal_angles_deg",
    "rotate_to",
    "system_modes",
]
