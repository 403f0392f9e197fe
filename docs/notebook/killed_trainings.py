"""Kills inside trainings of benchmarks.run: python docs/notebook/killed_trainings.py KILLS [SEED [...]].

Further arguments are INTERVAL and STEPS.
SNUG is trained at preset smoke, with STEPS steps and a checkpoint every INTERVAL seconds. At a random
time after the training began SIGKILL ends the command alone, whose workers have to end by themselves, or
all of its processes at once; then the same command is begun again, until the model is there. Its weights
are compared with those of a run that nobody killed. A training that ends before all kills are done is
followed by one with the next seed.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from benchmarks.results.run_folder import RunFolder, model_path
from snug.networks.tensor_file import read_tensors

LIFE = 10.0  # checkpoint intervals that a training lives at most
PATIENCE = 20.0  # [s] for workers to end after their command
METHOD = '''"""SNUG with a number of steps and an interval of checkpoints of its own."""

from dataclasses import replace
from multiprocessing import parent_process
from pathlib import Path

from benchmarks.methods.declared_networks import network
from benchmarks.presets import find_preset
from benchmarks.runner import networks as training
from benchmarks.method import Training
from snug.recipe import DEFAULT

find_preset("smoke").steps["snug"] = {steps}
training.CHECKPOINT_MINUTES = {interval} / 60.0
if parent_process() is not None:
    Path(__file__).with_suffix(".began").touch()
TRAINING = Training("snug", replace(DEFAULT, name="killed"))
METHODS = (network("snug-killed", "SNUG, killed", "SNUG, killed and begun again", training=TRAINING),)
'''


@dataclass(frozen=True)
class Kill:
    """One kill: of all processes or of the command alone; seconds of training lived and lost by it."""

    of_all: bool
    lived: float
    lost: float


class Training:
    """A run whose training is begun, killed and begun again; `model` is what it leaves."""

    def __init__(self, method: Path, folder: Path, seed: int) -> None:
        self.began, self.seed = method.with_suffix(".began"), seed
        self.model = model_path(RunFolder(folder).models_of("tshirt"), "snug-killed", seed)
        self.checkpoint = self.model.with_name(f".{self.model.stem}.checkpoint.safetensors")
        words = ["smoke", "--scenes", "tshirt/kick", "--methods", str(method), "--workers", "1"]
        self.command = [sys.executable, "-m", "benchmarks.run", *words]
        self.command += ["--seeds", str(seed), "-o", str(folder)]

    def live(self, seconds: float, *, of_all: bool) -> Kill | None:
        """Run until `seconds` of training have gone, then kill; None if the model is there before."""
        self.began.unlink(missing_ok=True)
        with tempfile.TemporaryFile() as output:
            run = subprocess.Popen(self.command, stdout=output, stderr=output, start_new_session=True)
            begun = float("inf")
            while not self.model.is_file() and time.time() < begun + seconds:
                if run.poll() is not None:
                    output.seek(0)
                    raise RuntimeError(output.read().decode()[-2000:])
                if begun == float("inf") and self.began.is_file():
                    begun = self.began.stat().st_mtime
                time.sleep(0.01)
            done, now = self.model.is_file(), time.time()
            for process in _of_session(run.pid) if of_all or done else (run.pid,):
                os.kill(process, signal.SIGKILL)
            run.wait()
        while _of_session(run.pid):
            if time.time() > now + PATIENCE:
                raise RuntimeError("workers go on without their command")
            time.sleep(0.01)
        if done:
            return None
        kept = self.checkpoint.stat().st_mtime if self.checkpoint.is_file() else 0.0
        return Kill(of_all, now - begun, now - max(kept, begun))


def _of_session(leader: int) -> list[int]:
    """Return the processes of a session that have not ended."""
    numbers = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            state, _, _, session = (folder / "stat").read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(session) == leader and state != "Z":
            numbers.append(int(folder.name))
    return numbers


def main(kills: int, seed: int = 0, interval: float = 3.0, steps: int = 1500) -> None:
    """Print each kill, how many weights differ at the end of each training, and the seconds lost."""
    random, done = np.random.default_rng(seed), []
    with tempfile.TemporaryDirectory() as name:
        method = Path(name, "killed.py")
        method.write_text(METHOD.format(steps=steps, interval=interval))
        for number in range(kills):
            whole, broken = (
                Training(method, Path(name, f"{n}-{number}"), number) for n in ("whole", "killed")
            )
            while True:
                life = LIFE * interval * random.random() if len(done) < kills else float("inf")
                if (kill := broken.live(life, of_all=bool(random.integers(2)))) is None:
                    break
                done.append(kill)
                print(f"{len(done)} {kill}", flush=True)
            whole.live(float("inf"), of_all=True)
            models = [read_tensors(training.model)[0] for training in (whole, broken)]
            differ = [key for key, value in models[0].items() if not torch.equal(value, models[1][key])]
            same = not differ and models[0].keys() == models[1].keys()
            print(
                f"training {number}: {len(models[0])} tensors, equal bit for bit: {same} {differ}",
                flush=True,
            )
            if len(done) == kills:
                break
    lost = np.array([kill.lost for kill in done])
    print(
        f"{kills} kills, {sum(kill.of_all for kill in done)} of all; checkpoints every {interval} s: "
        f"lost {np.median(lost):.1f} s (median), {lost.max():.1f} s (most)"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *map(float, sys.argv[3:4]), *map(int, sys.argv[4:]))
