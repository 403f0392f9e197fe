"""Known answers: the membrane against closed forms and scikit-fem. `cases.py` declares them."""
