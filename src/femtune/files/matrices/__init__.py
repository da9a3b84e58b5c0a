"""Matrices of other solvers: one small file a format, and a registry of their readers (`registry.read_matrix`)."""
