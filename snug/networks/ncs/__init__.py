"""The network of Neural Cloth Simulation: a static and a dynamic branch, and the joints that they read."""
