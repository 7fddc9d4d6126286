"""Find the pixels of one image of the object in another, and lift the answer to Gaussians.

Every matcher stands behind `animator.match.protocol.Matcher`; `animator.match.registry` makes one
by name.
"""
