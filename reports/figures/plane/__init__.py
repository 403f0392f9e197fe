"""The plane of run time and error: which methods are one curve, their markers, and labels beside them."""
