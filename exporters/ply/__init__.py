"""Gaussians as PLY files in the layout of the INRIA trainer, one a frame."""
