"""Garments: tailored by code to any body, or read from mesh files."""
