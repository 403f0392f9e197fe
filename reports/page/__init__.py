"""report.html: the garments of a run in motion, its plots and its tables, as one file that opens offline."""
