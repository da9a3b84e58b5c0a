"""Test against model: pairs, frequency errors, MAC, expansion of test shapes."""
