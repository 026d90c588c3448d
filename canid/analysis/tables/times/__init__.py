"""Times of day and dates as people's programs write them, and clocks of tables that begin anew."""
