"""Records of the model and of its checks."""
