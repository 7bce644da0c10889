"""The rows of numbers that the software PX4's kernels share: one module per row, one name per index."""
