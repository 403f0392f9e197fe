from .json_file import ResultsError as ResultsError
from .row import Row as Row
from .run_folder import RunFolder as RunFolder

__all__ = ["ResultsError", "Row", "RunFolder"]
