"""The baked body and the script that bakes it."""
