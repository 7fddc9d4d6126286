"""Rigid parts: region growing with PnP-RANSAC, then refinement while optimizing."""
