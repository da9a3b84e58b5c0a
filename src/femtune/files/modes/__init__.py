"""Natural modes that another solver wrote: frequencies, and shapes at its nodes."""
