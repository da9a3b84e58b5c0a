"""The updated deck."""
