"""Measured damping on the modes of the updated model."""
