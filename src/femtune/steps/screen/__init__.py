"""Effects of the parameters by designed runs."""
