"""The standing list of truths that any law, order parameter or body must pass, ours and a user's."""
