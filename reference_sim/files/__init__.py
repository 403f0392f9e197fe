"""Files of other programs and files written whole: arrays, meshes, UV charts."""
