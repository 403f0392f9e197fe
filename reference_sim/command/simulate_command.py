"""The command `python -m reference_sim.simulate`: a garment and an obstacle from files, a trajectory out."""

from __future__ import annotations

from collections.abc import Sequence

from reference_sim.command.command_line import command
from reference_sim.command.simulate_options import make_parser

PROGRAM = "simulate"


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with these arguments; return the exit status."""
    options = make_parser().parse_args(arguments)

    @command(PROGRAM, goes_on=f"--resume goes on from {options.output}")
    def run() -> int:
        from reference_sim.command.simulate_run import simulate_files  # loads the solver: not for --help
        from reference_sim.progress import announce_compilation

        announce_compilation()
        return simulate_files(options)

    return run()
