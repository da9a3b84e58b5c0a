"""Models made of matrices that another solver wrote."""
