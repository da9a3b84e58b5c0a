"""The journal of a run folder: full-model solutions that are not computed twice."""
