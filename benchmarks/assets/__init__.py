"""Body, garments and motions of a run: a user's files, each read once, and what is made for the body."""
