"""The standing list of truths that any law, order parameter, body, sensor or radio must pass, ours and a user's."""
