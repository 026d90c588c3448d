"""Results as documents of sections, sentences, tables and figures, and their three renderings: text, page, notebook."""
