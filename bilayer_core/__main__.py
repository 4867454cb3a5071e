"""``python -m bilayer_core``: the command line."""

import sys

from bilayer_core.cli import main

sys.exit(main())
