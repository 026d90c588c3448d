"""Strings of a DBC text, as a part of regular expressions."""

# Up to the first quote that no backslash precedes, and never further: what a lookahead has found is not tried again, and the
# group repeats it. A repeated group of characters and escapes says the same and remembers every repetition.
STRING = r'"(?=(?P<string>(?s:.*?))(?<!\\)")(?P=string)"'
