"""Geometry of triangle meshes: normals, closest points of one triangle, closed surfaces."""
