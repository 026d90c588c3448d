"""Pictures of the report of a diagnosis for the documentation."""
