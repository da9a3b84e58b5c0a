"""Comparison with data that the update did not use."""
