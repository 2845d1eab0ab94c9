"""`python -m bt_actions.cli`: the same as the console script."""

import sys

from bt_actions.cli import main

sys.exit(main())
