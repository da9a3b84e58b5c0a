"""Flat and curved shells."""
