"""Command `python -m reference_sim.simulate`. It is run, never imported.

Importing it would hide the function `reference_sim.simulate` behind this module of the same name.
"""

import sys

from reference_sim.command.simulate_command import main

if __name__ != "__main__":
    raise ImportError(
        "reference_sim.simulate is a command (python -m reference_sim.simulate); "
        "the function is `from reference_sim import simulate`"
    )

sys.exit(main())
