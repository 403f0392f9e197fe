from .build import build_report as build_report
from .figures.figure import Figure as Figure
from .run.finished_run import Run as Run
from .run.reading import read_run as read_run
from .tables.pivot import Pivot as Pivot
from .tables.table import Table as Table

__all__ = ["Figure", "Pivot", "Run", "Table", "build_report", "read_run"]
