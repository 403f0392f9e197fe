"""Known answers: contact without friction on a plane, a sphere and a drum. `cases.py` declares them."""
