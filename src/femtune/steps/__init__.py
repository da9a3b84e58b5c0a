"""The steps of a project, a folder each; what several steps share is beside the folders."""
