"""Files of other programs (meshes, UV charts, arrays), and files that appear whole or not at all."""
