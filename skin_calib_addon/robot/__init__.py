"""A URDF, and the meshes of its links."""
