"""`python -m airflock.onboard CARD ...`: run a node."""

import sys

from airflock.onboard.run import main

sys.exit(main())
