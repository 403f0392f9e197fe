"""Tables of textile tests (drape on meshes and steps, published bands, solvers) and of engines."""
