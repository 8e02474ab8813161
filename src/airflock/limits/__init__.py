"""Limits: what may happen how rarely, what many flights show of it, and what few flights let expect."""
