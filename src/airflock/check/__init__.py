"""The standing list of truths that any law, order parameter, body, sensor, radio or topology must pass."""
