"""The loop nests, one per stage of a flight, as driver text: index arithmetic and memory, never an equation."""
