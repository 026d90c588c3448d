"""Layer 6, analysis: drives, tables, drivers and fleets analysed, and the session on a bus; imports layers 1 to 5."""
