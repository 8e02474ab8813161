"""Rules as text: what a rule may hold, what it reads of a record, which of its numbers are integers."""
