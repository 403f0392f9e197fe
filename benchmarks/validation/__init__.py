"""Known answers and stress tests: declared as cases in four modules, measured by the others."""
