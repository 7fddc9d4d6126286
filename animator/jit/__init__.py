"""Just-in-time compilation: how kernels are compiled and the vector types they use."""
