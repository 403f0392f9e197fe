"""python -m benchmarks: list the commands; `garments COMMAND ...`, where it is installed, runs one."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Sequence
from difflib import get_close_matches

COMMANDS = {
    "run": ("benchmarks.run", "run a study: simulate, train, measure, report"),
    "score": ("benchmarks.score", "evaluate a roll-out of another program"),
    "export": ("benchmarks.export", "write a scene as plain files"),
    "check": ("benchmarks.check", "say whether files of your own keep the contract"),
    "submit": ("benchmarks.submit", "check and score an entry"),
    "publish": ("benchmarks.publish", "run published studies again"),
    "train": ("snug.train", "train a network"),
    "check-garment": ("snug.check", "say whether a garment can be used on a body"),
    "simulate": ("reference_sim.simulate", "simulate meshes of your own"),
    "report": ("reports.build", "make the report of a run again"),
    "compare": ("reports.compare", "compare two runs"),
    "film": ("reports.film", "film roll-outs"),
    "docs": ("reports.docs", "write generated parts of the documents"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command that the first word names; without one, list them. Return its exit status."""
    command = list(sys.argv[1:] if arguments is None else arguments)
    if not command or command[0] in ("-h", "--help"):
        for name, (module, text) in COMMANDS.items():
            print(f"{name:<14} python -m {module:<23} {text}")
        return 0
    if command[0] not in COMMANDS:
        names = get_close_matches(command[0], COMMANDS) or COMMANDS
        print(f"benchmarks: no command '{command[0]}': choose from {', '.join(names)}", file=sys.stderr)
        return 2
    module = COMMANDS[command[0]][0]
    sys.argv = [f"python -m {module}", *command[1:]]
    runpy.run_module(module, run_name="__main__", alter_sys=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
