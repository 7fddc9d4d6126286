"""Drawing Gaussians: one protocol, one renderer for CPUs and one for CUDA."""
