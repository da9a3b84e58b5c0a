"""Records of the update."""
