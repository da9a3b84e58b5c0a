"""Nominally identical specimens beside each other."""
