"""Body, garments and motions that scenes share."""
