"""Results of the steps as data with a schema; one file per step, with the functions that make its records."""
