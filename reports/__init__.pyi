from .build import build_report as build_report
from .figures.plotting import Figure as Figure
from .finished_run import Run as Run
from .finished_run import read_run as read_run
from .tables.table import Table as Table

__all__ = ["Figure", "Run", "Table", "build_report", "read_run"]
