"""The HTML page of a result, or of a run folder."""
