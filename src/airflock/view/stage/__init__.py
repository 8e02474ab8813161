"""Stage: what stands in a world as triangles and lines, agents as darts, and their colours; for any renderer."""
