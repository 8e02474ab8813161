"""`python -m airflock.drones.onboard CARD ...`: run a node."""

import sys

from airflock.drones.onboard.run import main

sys.exit(main())
