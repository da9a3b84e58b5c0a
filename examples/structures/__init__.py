"""Structures that tests, examples and benchmarks share."""
