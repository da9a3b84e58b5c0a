"""Records of the validation."""
