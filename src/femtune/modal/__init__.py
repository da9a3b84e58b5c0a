"""The language that test and model share: modes and frequency response functions, and how shapes compare."""

from femtune.modal.frf_kind import as_kind, frac
from femtune.modal.frf_set import FrfSet
from femtune.modal.mac import auto_mac, comac, cross_orthogonality, mac, modal_scale_factor
from femtune.modal.mode_set import ModeSet
from femtune.modal.subspace import Rotation, clusters, principal_angles_deg, rotate_to, subspace_mac

__all__ = [
    "FrfSet",
    "ModeSet",
    "Rotation",
    "as_kind",
    "auto_mac",
    "clusters",
    "comac",
    "cross_orthogonality",
    "frac",
    "mac",
    "modal_scale_factor",
    "principal_angles_deg",
    "rotate_to",
    "subspace_mac",
]
