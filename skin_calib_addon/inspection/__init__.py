"""Inspection of taxels: values of layers, comparison with a file, replay of a recording."""
