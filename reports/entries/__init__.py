"""The command python -m reports.entries: the page of all entries beside the published methods."""
