"""The files of a run: all that a report knows of a benchmark."""
