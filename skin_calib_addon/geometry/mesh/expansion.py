"""Limits of files that become much larger when they are read, because parts are repeated."""

MAX_NODES = 20_000  # of a scene, each as often as it is instanced. Larger: slower malicious files
MAX_REPEATED_FACES = 1_000_000  # of a file with fewer bytes than six for each. Larger: malicious files take more memory
BYTES_PER_FACE = 6  # Least of a face that is in the file itself: three indices of two bytes


def check_nodes(count: int) -> None:
    """Refuse a scene with too many nodes, such as one whose nodes are in a circle."""
    if count > MAX_NODES:
        raise ValueError(f"its scene has more than {MAX_NODES} nodes, or they are in a circle")


def check_faces(count: int, size: int) -> None:
    """Refuse a file of ``size`` bytes whose scene repeats parts too often."""
    if count > max(MAX_REPEATED_FACES, size // BYTES_PER_FACE):
        raise ValueError(f"its scene repeats parts, and has {count} faces then; export this link alone")
