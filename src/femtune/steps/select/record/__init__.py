"""The records in results.json."""
