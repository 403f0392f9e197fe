"""Contact planes for training: cached anchors, queried anew as the network learns."""
