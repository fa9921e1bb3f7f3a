"""Commands of the command line: ``add`` defines the arguments of a parser, ``run`` returns the exit code."""
