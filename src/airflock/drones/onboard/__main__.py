"""`python -m airflock.drones.onboard CARD ...`: run a node."""

import sys

from airflock.drones.onboard.node_program import main

sys.exit(main())
