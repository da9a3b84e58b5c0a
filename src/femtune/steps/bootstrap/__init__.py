"""Spread of the updated parameters by a bootstrap of the measured FRFs."""
