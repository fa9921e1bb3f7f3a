"""Where planes and lines of control points go."""
