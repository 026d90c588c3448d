"""Layer 7, ui: terminal, views, live page and command line; imports all layers, none imports it."""
