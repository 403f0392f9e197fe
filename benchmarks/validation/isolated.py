"""Cases one after another in a process of their own, which is ended at a case's deadline and started anew."""

from __future__ import annotations

import atexit
from functools import cache

from ..guarded import Broken, Guarded
from ..results import Row
from .case import WARM_UP_SECONDS, Case, timed_out


def run_isolated(case: Case) -> Row:
    """The row of one case, measured in the shared process. A hang or a crash there is a failed row."""
    try:
        process = shared_process()
        process.call(case.warm_up, seconds=WARM_UP_SECONDS)
        return process.call(case.run, seconds=case.seconds)
    except Broken as error:
        return timed_out(case, str(error))
    except Exception as error:
        return timed_out(case, f"{type(error).__name__}: {error}")


@cache
def shared_process() -> Guarded:
    """The one worker process of this process."""
    process = Guarded()
    atexit.register(process.close)
    return process
