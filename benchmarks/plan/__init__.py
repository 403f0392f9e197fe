"""The plan of a run: from a study to cells, cases, motions and the inputs of a user."""
