"""Known answers: hinges against closed forms, plates and the elastica. `cases.py` declares them."""
