"""One module for each command of the command line: ``add`` describes it, ``run`` does it and gives the exit code."""
