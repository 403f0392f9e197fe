"""Tables, figures and the PDF of a run, made from its result files alone."""
