"""Records of the verdict."""
