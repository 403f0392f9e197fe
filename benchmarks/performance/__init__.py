"""Folder that asv reads (asv.conf.json): microbenchmarks.py."""
