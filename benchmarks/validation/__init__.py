"""Known answers and extreme steps. registry.py lists the modules that declare them."""
