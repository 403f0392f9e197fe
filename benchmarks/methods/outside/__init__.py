"""Methods from outside: stored roll-outs and programs."""
