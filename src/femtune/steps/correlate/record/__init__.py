"""Records of the comparison of test and model."""
