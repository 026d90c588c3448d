"""A recorded drive: read, identified over windows and as a whole, summarised, and a vehicle file checked against it."""
