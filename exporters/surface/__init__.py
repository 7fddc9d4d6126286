"""A closed surface around the Gaussians, as a mesh that follows the joints."""
