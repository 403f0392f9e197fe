"""Work that may hang or crash: done in a process of its own, which is ended at a deadline.

A solver's own timeout is looked at between its iterations; a loop that never ends, or compiled code that
takes the interpreter down with it, has to be stopped from outside.
"""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable
from typing import Any


class Broken(RuntimeError):
    """The work did not come back: it ran past its deadline, or its process ended; the message says which."""


class Guarded:
    """One worker process, started when first needed, and again after it had to be ended.

    Use it in a `with` block, or call `close`.
    """

    def __init__(self) -> None:
        self._context = multiprocessing.get_context("spawn")
        self._process: Any = None
        self._pipe: Any = None

    def call(self, function: Callable[..., Any], *arguments: Any, seconds: float) -> Any:
        """function(*arguments) in the worker; both sides must be picklable.

        Raises what the function raises, and Broken after `seconds` or where the process ended.
        """
        if self._process is None:
            self._pipe, far = self._context.Pipe()
            self._process = self._context.Process(target=_serve, args=(far,), daemon=True)
            self._process.start()
            far.close()
        try:
            self._pipe.send((function, arguments))
            if not self._pipe.poll(seconds):
                raise Broken(f"no answer within {seconds:g} s")
            fine, answer = self._pipe.recv()
        except (EOFError, ConnectionError):
            self._process.join()
            code = self._process.exitcode
            self.close()
            raise Broken(f"the process ended with status {code}") from None
        except Broken:
            self.close()
            raise
        if fine:
            return answer
        raise answer

    def close(self) -> None:
        """End the worker, whatever it does."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._pipe.close()
            self._process = None

    def __enter__(self) -> Guarded:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _serve(pipe: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent alone answers an interrupt
    while True:
        try:
            function, arguments = pipe.recv()
        except EOFError:
            return
        try:
            answer = (True, function(*arguments))
        except Exception as error:
            answer = (False, error)
        pipe.send(answer)
