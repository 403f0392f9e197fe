"""What all compiled kernels share: their cache on disk, lanes of elements, indices of blocks."""
