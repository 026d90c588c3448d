"""Speed of `canid replay`, by stage."""
