"""Sweeps and random vibration tests beside the model."""
