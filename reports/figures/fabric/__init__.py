"""Figures of textile tests."""
