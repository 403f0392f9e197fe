"""Tables of textile tests: drape on meshes and steps, published bands, order of fabrics by solvers."""
