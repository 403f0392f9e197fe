"""Known answers: derivatives of all terms but friction and IPC's barrier, properties of the minimisers.

`cases.py` declares them. Derivatives of friction and barrier are tested in tests/reference_sim/energies.
"""
