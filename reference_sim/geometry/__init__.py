"""Geometry of triangle meshes: edges and areas, normals and contact planes, closest points."""
