"""The language that test and model share: modes and frequency response functions."""

from femtune.modal.frf_set import FrfSet
from femtune.modal.mode_set import ModeSet

__all__ = ["FrfSet", "ModeSet"]
