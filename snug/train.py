"""The command `python -m snug.train`: train garment networks and write each to a file."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from reference_sim.command_line import command
from snug.training.command.options import check_options, parse_options


@command("snug.train", goes_on="--resume goes on from there")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    options = parse_options(arguments)
    # Not before: --help does without torch.
    import torch

    from snug.body.smpl_files import read_body
    from snug.training.command.choices import choose_garments, choose_motions, output_files
    from snug.training.command.train_to_file import train_to_file
    from snug.training.device import find_device
    from snug.training.process_group import join_group, leave_group
    from snug.training.simulated_data import DataSet
    from snug.training.training_loop import Interrupted

    check_options(options)
    garments = choose_garments(options)
    outputs = output_files(Path(options.out), garments)
    device = find_device(options.device)
    torch.set_num_threads(options.threads)
    data = DataSet.read(options.dataset) if options.dataset else None
    motions, held_out = choose_motions(options, data)
    stop = _StopRequest()
    group, device = join_group(device)
    if options.motions and group.writes:
        for motion in [*motions, *held_out]:
            print(f"motion {motion.name}: {motion.source}", file=sys.stderr)
    try:
        body = read_body(options.body)
        outputs[0].parent.mkdir(parents=True, exist_ok=True)
        for garment, output in zip(garments, outputs):
            train_to_file(
                options, body, garment, motions, held_out, data, output,
                device=str(device), group=group, stop=stop,
            )  # fmt: skip
    except Interrupted as interrupted:
        if group.writes:
            print(f"snug.train: {interrupted}; go on with --resume", file=sys.stderr)
        return 130
    finally:
        leave_group()
        stop.restore()
    return 0


class _StopRequest:
    """True once the process was asked to end; a second request ends it at once."""

    def __init__(self) -> None:
        self.received = False
        self._before = {n: signal.signal(n, self._receive) for n in (signal.SIGINT, signal.SIGTERM)}

    def _receive(self, number: int, frame: FrameType | None) -> None:
        self.received = True
        signal.signal(number, signal.SIG_DFL)

    def __call__(self) -> bool:
        return self.received

    def restore(self) -> None:
        """Put back the handlers that were there before: `main` may be called by a longer program."""
        for number, handler in self._before.items():
            signal.signal(number, handler)


if __name__ == "__main__":
    sys.exit(main())
