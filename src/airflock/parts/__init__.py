"""Parts: plain scalar rules with their numbers, one folder a kind."""
