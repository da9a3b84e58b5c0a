"""Mean and covariance of the parameters from repeated tests."""
