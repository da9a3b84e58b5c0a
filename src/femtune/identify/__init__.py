"""From records to modes."""
