"""Records of what the data determine."""
