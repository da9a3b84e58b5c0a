"""Modes with standard deviations from records or FRFs."""
