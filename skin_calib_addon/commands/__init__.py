"""Commands of the command line: ``add`` defines the arguments, ``run`` executes the command, returns the exit code."""
