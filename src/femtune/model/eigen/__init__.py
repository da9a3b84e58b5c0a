"""Natural modes: block Lanczos, proof by Sturm counts, SLEPc over MPI."""
