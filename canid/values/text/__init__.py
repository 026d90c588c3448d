"""Values as text: names, numbers with their intervals, sentences, and JSON."""
