"""Files: created without overwriting, identified, followed when they move, replaced atomically."""
