"""Log files written from the pages docs/formats/*.md alone: their frames are known before they are written."""
