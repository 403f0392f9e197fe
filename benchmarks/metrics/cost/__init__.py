"""Metrics of cost, and of what a network was trained on."""
