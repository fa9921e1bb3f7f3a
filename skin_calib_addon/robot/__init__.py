"""Read a URDF and the meshes of its links."""
