"""Untimed tasks on a cluster of dask.distributed that the user has started; timed ones here, alone.

dask hands tasks to workers, does them again where a worker died, and ships their outcomes. Files lie in the
run's folder, which all machines have to see under one path.
"""

from __future__ import annotations

import dataclasses
import pickle
import sys
import time
import uuid
from collections import deque
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from benchmarks.assets.assets import Assets
from benchmarks.fingerprint.digest import damaged
from benchmarks.process.cluster_address import connect
from benchmarks.process.errors import one_line
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner import cluster_worker
from benchmarks.runner.local_executor import POLL, Done, LocalExecutor, Ready
from benchmarks.runner.task_process import Needed
from benchmarks.tasks.task import Outcome, RunStopped, Task

if TYPE_CHECKING:
    from distributed import Future
    from tqdm import tqdm

LOOK = 2.0  # [s] between looks at which workers there are and how far they are
PATIENCE = 60.0  # [s] for a scheduler that was lost to be there again


@dataclass(eq=False)
class _Batch:
    """Tasks done one after another, by one process of one worker if it lives: what is left of them.

    A worker that is given a task of another batch in between forgets what this one had in its memo.
    worker: address of the one that did the last; allowed: where the next may be done, empty: anywhere.
    """

    tasks: deque[Task]
    needed: Needed
    key: str = field(default_factory=lambda: uuid.uuid4().hex)
    worker: str = ""
    allowed: frozenset[str] = frozenset()


class ClusterExecutor(LocalExecutor):
    """Workers of a cluster for tasks that are not timed, as many side by side as they have threads.

    Workers may come and go. Raises ClusterError where no scheduler answers.
    """

    def __init__(self, folder: RunFolder, assets: Assets | None, workers: int, address: str) -> None:
        super().__init__(folder, assets, workers)
        self.address = address
        self._client = connect(address, seconds=PATIENCE)
        self._path = str(folder.path.resolve())
        self._assets_file = folder.path / f".assets-{uuid.uuid4().hex}.part"  # see RunFolder.remove_parts
        self._threads: dict[str, int] = dict(self._client.nthreads())
        self._unfit: dict[str, str] = {}  # address -> why the worker can do no task
        self._at_work: dict[Future, _Batch] = {}
        self._waiting: deque[_Batch] = deque()
        self._looked = 0.0
        self._opened = self._said_alone = False

    def together(self, ready: Ready, bar: tqdm) -> Iterator[Done]:
        """Yield tasks with their outcomes until none is at work and none is ready."""
        self._open()
        try:
            while self._wait_for(ready) or self._at_work:
                self._look(bar)
                self._hand_out(ready)
                done: list[Done] = []
                ended = [future for future in self._at_work if future.done()]
                for future in ended:
                    done += self._take(future)
                    self._hand_out(ready)  # at once: it does not wait while results of others are kept
                yield from done
                if not ended:
                    time.sleep(POLL)
        except BaseException:
            self._dismiss()
            raise

    def close(self) -> None:
        """End everything that was begun on the cluster and here."""
        super().close()
        self._client.close()
        self._assets_file.unlink(missing_ok=True)

    @property
    def side_by_side(self) -> int:
        """The number of the cluster's threads, each of which does one untimed task at a time."""
        return max(1, sum(self._threads.values()))

    def _open(self) -> None:
        """Let workers begin with the run, and end what a command that was killed has left in its folder."""
        if not self._assets_file.is_file():
            self._assets_file.write_bytes(pickle.dumps(self.assets))
        self._opened, self._looked = True, 0.0
        self._end_processes()

    def _dismiss(self) -> None:
        """Cancel what the cluster does, so that none of it is beside a timed task."""
        super()._dismiss()
        for future in self._at_work:
            future.cancel()
        self._at_work.clear()
        self._waiting.clear()
        if self._opened:
            self._end_processes()
        self._opened = False

    def _end_processes(self) -> None:
        if self._client.status == "running":
            with suppress(OSError):  # no scheduler: its workers end by themselves
                self._client.run(cluster_worker.end_processes, self._path, on_error="ignore")

    def _look(self, bar: tqdm) -> None:
        """Learn which workers there are and what they tell. Raises RunStopped where nothing can go on."""
        if time.monotonic() < self._looked + LOOK:
            return
        if self._client.status == "closed":
            raise RunStopped(f"the scheduler {self.address} is gone and was not back in {PATIENCE:g} s")
        try:
            self._threads = dict(self._client.nthreads())
            progress = self._client.run(
                cluster_worker.progress, self._path, workers=list(self._threads), on_error="ignore"
            )  # fmt: skip
        except OSError:  # no scheduler: the client is looking for it
            return
        finally:
            self._looked = time.monotonic()
        bar.update(min(sum(progress.values()), bar.total - bar.n))
        if self._threads and self._unfit.keys() >= self._threads.keys():
            raise RunStopped(f"no worker of {self.address} can be used: {next(iter(self._unfit.values()))}")
        for future, batch in self._at_work.items():
            if batch.allowed and batch.allowed.isdisjoint(self._threads):
                future.cancel()
        if not self._threads and not self._said_alone:
            self._said_alone = True
            print(f"waiting for workers: dask worker {self.address} --nthreads 1 --no-nanny", file=sys.stderr)

    def _wait_for(self, ready: Ready) -> bool:
        """Return whether a batch waits for a thread; ask for one where none does."""
        if not self._waiting and (batch := ready()):
            self._waiting.append(_Batch(deque(batch[0]), batch[1]))
        return bool(self._waiting)

    def _hand_out(self, ready: Ready) -> None:
        """Submit a task for each thread that has none."""
        threads = sum(n for address, n in self._threads.items() if address not in self._unfit)
        while len(self._at_work) < threads and self._wait_for(ready):
            self._submit(self._waiting.popleft())

    def _submit(self, batch: _Batch) -> None:
        """Submit the next task of a batch, to the worker that did the last one where it is still there."""
        task, fit = batch.tasks[0], self._threads.keys() - self._unfit.keys()
        known = batch.worker in fit
        batch.allowed = frozenset(fit) if self._unfit else frozenset()
        work = pickle.dumps((task, batch.needed, cluster_worker.software_of(task)))
        future = self._client.submit(
            cluster_worker.do_task, self._path, self._assets_file.name, batch.key, work,
            key=f"{task.kind}-{uuid.uuid4().hex}", pure=False,
            workers=[batch.worker] if known else sorted(batch.allowed) or None, allow_other_workers=known,
        )  # fmt: skip
        self._at_work[future] = batch

    def _take(self, future: Future) -> list[Done]:
        """Return the outcome of a task that has ended, if it has one, and submit the next of its batch."""
        from distributed import KilledWorker

        batch = self._at_work.pop(future)
        try:
            answer = future.result(timeout=LOOK)
        except CancelledError:  # the scheduler died, or every worker that was allowed
            self._threads, self._looked = {}, 0.0
            self._waiting.appendleft(batch)
            return []
        except KilledWorker as error:
            reason = f"{error.allowed_failures + 1} workers died while they did it: "
            outcome = Outcome("failed", f"{reason}the last was {error.last_worker.address}", failed=True)
        except OSError:  # it went with its worker; dask does it again
            self._at_work[future] = batch
            return []
        except Exception as error:
            if isinstance(error, RunStopped):
                raise
            raise RunStopped(
                f"the cluster {self.address}: {batch.tasks[0].title}: {one_line(error)}"
            ) from None
        else:
            if answer.unfit:
                self._unfit[answer.worker] = f"worker {answer.worker}: {answer.unfit}"
                print(f"left out: {self._unfit[answer.worker]}", file=sys.stderr)
                self._waiting.appendleft(batch)
                return []
            if damage := damaged(self.folder.path, answer.outcome.digests):
                raise RunStopped(f"{damage}, seen from here, since worker {answer.worker} wrote it")
            outcome = dataclasses.replace(answer.outcome, origin={"hardware": answer.hardware})
            batch.worker = answer.worker
        task = batch.tasks.popleft()
        if batch.tasks:
            self._submit(batch)
        return [(task, outcome)]
