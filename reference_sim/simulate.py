"""Command `python -m reference_sim.simulate`; imported, the name stays that of the function."""

import sys

from reference_sim.simulate_command import main

if __name__ == "__main__":
    sys.exit(main())

from reference_sim.time_loop import simulate

# An import would put this module in the place of the function `reference_sim.simulate`.
sys.modules[__name__] = simulate  # type: ignore[assignment]
