"""A first study from a deck and a test."""
