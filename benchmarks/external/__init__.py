"""Roll-outs of other programs: which files are read, and whether they belong to the scene."""
