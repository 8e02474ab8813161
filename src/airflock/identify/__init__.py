"""Layer 6: from flight logs to the numbers of a scenario, with intervals and with reasons where there are none."""
