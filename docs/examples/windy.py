"""SNUG trained on windows of four frames, in a wind."""

from dataclasses import replace

from wind import Wind

from benchmarks.method import Training
from benchmarks.methods.declared_networks import network
from snug.recipe import DEFAULT, TERMS

RECIPE = replace(DEFAULT, name="windy", window=4, batch=12, terms=(*TERMS, Wind.name))
TRAINING = Training("snug", RECIPE)
METHODS = (network("snug-windy", "SNUG, windy", "SNUG, trained in a wind", training=TRAINING),)
