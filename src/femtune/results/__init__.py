"""What a step found, as data with a schema: the record and its making together, one file a step."""
