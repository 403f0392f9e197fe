"""Known answers of membrane and hinges: closed forms, scikit-fem, plates, large bending."""
