"""How the example object is made from nothing: surfaces, patterns, splats, pictures."""
