"""The verbs, one per file; `canid.ui.cli.verbs` lists them."""
