"""Which parameters the data determine."""
