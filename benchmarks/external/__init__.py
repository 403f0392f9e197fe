"""Roll-outs and scenes of other programs."""
