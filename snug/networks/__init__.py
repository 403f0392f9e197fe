"""Networks that dress a body: architectures, inputs, trained models, roll-outs."""
