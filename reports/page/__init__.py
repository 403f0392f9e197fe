"""The page of a run, report.html: garments in motion, plots and tables in one file that opens offline."""
