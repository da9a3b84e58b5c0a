"""A study put together: its files, parameters, configurations, tests and residuals as one frozen whole."""
