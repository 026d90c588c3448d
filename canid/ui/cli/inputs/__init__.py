"""What a verb reads: logs, tables, sides of a comparison, and answers of a person."""
