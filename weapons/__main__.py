"""`python -m weapons` is the command `hitplanes`."""

import sys

from weapons.cli import main

sys.exit(main())
