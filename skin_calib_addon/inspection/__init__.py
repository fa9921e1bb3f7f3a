"""Values of taxels to look at: numbers by layer, comparison with a file, replay of a recording."""
