"""Clips as USD: a skinned asset, and a cache of time-sampled Gaussians."""
