"""The verbs, one per file; `canid.cli.verbs` lists them."""
