"""Residuals of measured frequency response functions."""
