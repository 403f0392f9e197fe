"""How fast the simulator, trainings and trained networks are: microbenchmarks, declared in registry.py."""
