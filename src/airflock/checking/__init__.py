"""The standing list of truths that any law, order parameter, body or sensor must pass, ours and a user's."""
