"""What a run is to do: the options of the command, the suites and presets, and the plan made of them."""
