"""Where planes and rays cut a mesh."""
