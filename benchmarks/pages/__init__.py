"""What the pages of many drives say, read as a reader does."""
