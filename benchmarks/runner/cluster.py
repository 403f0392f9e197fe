"""Untimed tasks on a cluster of dask.distributed that the user has started; timed ones here, alone.

The runner gives each thread of a worker one task at a time, and knows what has ended with a worker. Files go
from here to a worker and back in pieces, outside of dask's own store: no disk is shared, and of a file of any
size one piece at a time is in memory. What a worker keeps for a run is gone with the run, or with the worker.
"""

from __future__ import annotations

import dataclasses
import io
import pickle
import sys
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, BinaryIO

from benchmarks.assets.assets import Assets
from benchmarks.cell import TaskId
from benchmarks.fingerprint.digest import damaged, digest, digest_of_file
from benchmarks.process.errors import one_line
from benchmarks.process.scheduler import connect
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner import cluster_worker
from benchmarks.runner.cluster_worker import ASSETS, PIECE, Gone, Unfit
from benchmarks.runner.local_executor import POLL, Done, LocalExecutor, Needed, Ready
from benchmarks.tasks.task import Outcome, RunStopped, Task, failure
from reference_sim.files.atomic_files import replacing

ATTEMPTS = 3  # workers that may die of a task
LOOK = 2.0  # [s] between looks at which workers there are and how far they are
PATIENCE = 60.0  # [s] for a scheduler that was lost to be there again


@dataclass
class _Lane:
    """One thread of a worker, and what is left of its batch. fresh: nothing of that is done yet."""

    number: int
    batch: deque[Task] = field(default_factory=deque)
    needed: Needed = field(default_factory=dict)
    fresh: bool = True
    future: Any = None


@dataclass(eq=False)
class _Worker:
    """A worker as the runner knows it. has: names and digests of the files that lie there."""

    address: str
    hardware: str
    lanes: list[_Lane]
    has: dict[str, str] = field(default_factory=dict)


class ClusterExecutor(LocalExecutor):
    """Workers of a cluster for tasks that are not timed, as many side by side as they have threads.

    A task whose worker died goes to another, ATTEMPTS in all. Workers may come and go. Raises ClusterError.
    """

    def __init__(self, folder: RunFolder, assets: Assets | None, workers: int, address: str) -> None:
        super().__init__(folder, assets, workers)
        self.address = address
        self._client = connect(address, seconds=PATIENCE)
        self._run = uuid.uuid4().hex
        self._packed = pickle.dumps(assets)
        self._workers: dict[str, _Worker] = {}
        self._unfit: dict[str, str] = {}
        self._died: dict[TaskId, list[str]] = {}  # addresses of the workers that died of a task
        self._waiting: deque[tuple[deque[Task], Needed]] = deque()
        self._finished: deque[Done] = deque()
        self._ready: Ready = lambda: None
        self._opened = False  # whether any worker has begun with the run
        self._looked = 0.0
        self._said_alone = False

    def together(self, ready: Ready, bar: Any) -> Iterator[Done]:
        self._ready = ready
        self._looked = 0.0  # whoever has gone meanwhile would be asked in vain for half a minute
        try:
            while self._fill() or self._busy() or self._finished:
                self._look(bar)
                self._hand_out()
                ended = [(worker, lane) for worker, lane in self._busy() if lane.future.done()]
                for worker, lane in ended:
                    if self._knows(worker):
                        self._take(worker, lane)
                while self._finished:
                    yield self._finished.popleft()
                if not ended:
                    time.sleep(POLL)
        except BaseException:
            self._waiting.clear()
            self._dismiss()
            raise

    def close(self) -> None:
        super().close()
        self._client.close()

    def _fill(self) -> bool:
        """Whether a batch waits for a thread; asks for one where none does."""
        if not self._waiting and (batch := self._ready()):
            self._waiting.append((deque(batch[0]), batch[1]))
        return bool(self._waiting)

    def _dismiss(self) -> None:
        """Cancel what the cluster does, and let it forget the run: none of it is beside a timed task."""
        super()._dismiss()
        for _, lane in self._busy():
            lane.future.release()
        self._workers.clear()
        if self._opened and self._client.status == "running":
            with suppress(OSError):  # no scheduler: its workers end by themselves
                self._client.run(cluster_worker.close_run, self._run, on_error="ignore")
        self._opened = False
        self._run = uuid.uuid4().hex

    # --- workers -------------------------------------------------------------------------------------------

    def _busy(self) -> list[tuple[_Worker, _Lane]]:
        return [(w, lane) for w in self._workers.values() for lane in w.lanes if lane.future is not None]

    def _knows(self, worker: _Worker) -> bool:
        return self._workers.get(worker.address) is worker

    def _look(self, bar: Any) -> None:
        """Which workers have come, which are gone, and what they tell. Raises RunStopped without hope."""
        if time.monotonic() < self._looked + LOOK:
            return
        if self._client.status == "closed":
            raise RunStopped(f"the scheduler {self.address} is gone and was not back in {PATIENCE:g} s")
        client = self._client
        try:
            threads = client.nthreads()
            for worker in [w for address, w in self._workers.items() if address not in threads]:
                self._lose(worker, died=True)
            self._open({a: n for a, n in threads.items() if a not in self._workers and a not in self._unfit})
            if self._workers:
                names = list(self._workers)
                told = client.run(cluster_worker.progress, self._run, workers=names, on_error="ignore")
                bar.update(min(sum(told.values()), bar.total - bar.n))
        except OSError:  # no scheduler: the client is looking for it
            return
        finally:
            self._looked = time.monotonic()
        if threads and self._unfit.keys() >= threads.keys():
            raise RunStopped(f"no worker of {self.address} can be used: {next(iter(self._unfit.values()))}")
        if not threads and not self._said_alone:
            self._said_alone = True
            print(f"waiting for workers: dask worker {self.address} --nthreads 1 --no-nanny", file=sys.stderr)

    def _open(self, threads: Mapping[str, int]) -> None:
        """Let these workers begin with the run."""
        if not threads:
            return
        self._opened = True
        begin, addresses = cluster_worker.open_run, list(threads)
        answers = self._client.run(begin, self._run, workers=addresses, on_error="return")
        for address, answer in answers.items():
            if isinstance(answer, str):
                self._workers[address] = _Worker(address, answer, [_Lane(n) for n in range(threads[address])])
            elif not isinstance(answer, OSError):  # one that has just gone
                self._leave_out(address, answer)

    def _leave_out(self, address: str, error: BaseException) -> None:
        """Give no task to a worker any more, and say why."""
        why = str(error) if isinstance(error, Unfit | RunStopped) else one_line(error)
        self._unfit[address] = f"worker {address}: {why}"
        print(f"left out: {self._unfit[address]}", file=sys.stderr)

    def _fail(self, worker: _Worker, error: Exception) -> None:
        """Give up a worker for what came of it: it has died, or it can do no task."""
        from distributed import KilledWorker

        died = isinstance(error, OSError | Gone | KilledWorker)
        if not died:
            self._leave_out(worker.address, error)
        self._lose(worker, died=died)

    def _lose(self, worker: _Worker, *, died: bool) -> None:
        """Know a worker no longer: what it was at goes to another; what ATTEMPTS died of has failed."""
        del self._workers[worker.address]
        for lane in worker.lanes:
            if died and lane.future is not None and not lane.future.cancelled():  # else the scheduler died
                task = lane.batch[0]
                of = self._died.setdefault(task.id, [])
                of.append(worker.address)
                if len(of) == ATTEMPTS:
                    reason = f"{ATTEMPTS} workers died while they did it: {', '.join(of)}"
                    self._finished.append((lane.batch.popleft(), Outcome("failed", reason, failed=True)))
            if lane.future is not None:
                lane.future.release()
            if lane.batch:
                self._waiting.appendleft((lane.batch, lane.needed))

    # --- tasks ---------------------------------------------------------------------------------------------

    def _hand_out(self) -> None:
        """A batch to each thread that has none."""
        for worker in list(self._workers.values()):
            for lane in worker.lanes:
                if self._knows(worker) and not lane.batch:
                    self._go_on(worker, lane)

    def _go_on(self, worker: _Worker, lane: _Lane) -> None:
        """The next task of its batch to a thread, or the first of another."""
        if not lane.batch and self._fill():
            lane.batch, lane.needed = self._waiting.popleft()
            lane.fresh = True
        if lane.batch:
            self._hand(worker, lane)

    def _hand(self, worker: _Worker, lane: _Lane) -> None:
        """The next task of its batch to a thread, once all files that it needs are there."""
        task = lane.batch[0]
        try:
            if ASSETS not in worker.has:
                self._send(worker, ASSETS, digest(self._packed), io.BytesIO(self._packed))
            for outcome in lane.needed.values():
                for name, content in outcome.digests.items():
                    self._send(worker, name, content)
        except (Gone, Unfit) as error:
            self._fail(worker, error)
            return
        work = pickle.dumps((task, lane.needed, cluster_worker.software_of(task)))
        lane.future = self._client.submit(
            cluster_worker.do_task, self._run, lane.number, lane.fresh, work,
            key=f"{task.kind}-{uuid.uuid4().hex}", pure=False, workers=[worker.address],
        )  # fmt: skip
        lane.fresh = False

    def _take(self, worker: _Worker, lane: _Lane) -> None:
        """The outcome of a task that has ended, with its files; then the next task."""
        try:
            outcome = lane.future.result(timeout=LOOK)
        except TimeoutError:  # it went with its worker, whose end the next look finds
            return
        except CancelledError:  # the scheduler died
            self._lose(worker, died=False)
            return
        except Exception as error:
            self._fail(worker, error)
            return
        try:
            for name, content in outcome.digests.items():
                self._fetch(worker, name, content)
        except (Gone, Unfit) as error:
            self._fail(worker, error)
            return
        except OSError as error:  # of a file here; raises RunStopped where there is no room
            outcome = failure(error)
        outcome = dataclasses.replace(outcome, origin={"hardware": worker.hardware})
        self._finished.append((lane.batch.popleft(), outcome))
        lane.future = None
        self._go_on(worker, lane)  # at once: it does not wait while results of others are taken

    # --- files ---------------------------------------------------------------------------------------------

    def _send(self, worker: _Worker, name: str, content: str, stream: BinaryIO | None = None) -> None:
        """A file to a worker that does not have it. Raises Gone, Unfit, RunStopped."""
        if worker.has.get(name) == content:
            return
        if stream is None:
            if damage := damaged(self.folder.path, {name: content}):
                raise RunStopped(f"{damage} since this run wrote it")
            stream = (self.folder.path / name).open("rb")
        with stream:
            offset, piece, rest = 0, stream.read(PIECE), stream.read(PIECE)
            while True:
                last = content if not rest else ""
                self._asked(worker, cluster_worker.put_piece, name, offset, piece, last)
                if last:
                    break
                offset, piece, rest = offset + len(piece), rest, stream.read(PIECE)
        worker.has[name] = content

    def _fetch(self, worker: _Worker, name: str, content: str) -> None:
        """A file that a worker has made, whole or not at all. Raises Gone, Unfit, OSError of this machine."""
        with replacing(self.folder.path / name) as temporary:
            with temporary.open("wb") as stream:
                while piece := self._asked(worker, cluster_worker.get_piece, name, stream.tell()):
                    stream.write(piece)
            if digest_of_file(temporary) != content:
                raise Unfit(f"{name} came damaged")
        worker.has[name] = content

    def _asked(self, worker: _Worker, function: Callable[..., Any], *arguments: Any) -> Any:
        """function(run, *arguments) in the worker. Raises what it raises, Gone where there is no answer."""
        try:
            return self._client.run(function, self._run, *arguments, workers=[worker.address])[worker.address]
        except OSError as error:
            raise Gone(one_line(error)) from None
