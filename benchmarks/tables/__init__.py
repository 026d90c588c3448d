"""Reading of tables of named columns."""
