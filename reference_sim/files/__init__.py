"""Files: arrays, meshes and rest charts of other programs; files that appear whole or not at all."""
