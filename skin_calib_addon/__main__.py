"""``python -m skin_calib_addon``: the command line."""

import sys

from .cli import main

sys.exit(main())
