"""Sparse and dense products of symmetric matrices, and the memory they need."""
