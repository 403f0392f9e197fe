"""How a run is done: its tasks in order, their processes, their cache, and a cluster where there is one."""
