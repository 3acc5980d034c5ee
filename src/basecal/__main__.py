"""`python -m basecal`."""

import sys

from basecal.cli import main

sys.exit(main())
