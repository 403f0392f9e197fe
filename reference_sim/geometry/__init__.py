"""Geometry of triangle meshes: edges, areas, normals, closest points, winding numbers."""
