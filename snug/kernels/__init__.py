"""Compiled closed forms for a CPU: recurrent networks, skinning, contact, one frame of a roll-out."""
