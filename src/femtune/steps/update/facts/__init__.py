"""The update as records: from what ran to what `results.json` holds."""
