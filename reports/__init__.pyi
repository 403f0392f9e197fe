from .build import build_report as build_report
from .figures.figure import Figure as Figure
from .run.finished_run import Run as Run
from .run.reading import read_run as read_run
from .tables.table import Table as Table

__all__ = ["Figure", "Run", "Table", "build_report", "read_run"]
