"""Values → text: no clock, no file, no terminal is touched here."""
