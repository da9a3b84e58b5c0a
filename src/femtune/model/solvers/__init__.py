"""Sparse factorisations, one file each, and what is known of each."""
