"""Several sets of parameters, updated and compared."""
