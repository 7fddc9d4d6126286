"""Anchors and their skin, the energy of one frame, and its two solvers."""
