"""What the estimators know, as bytes that outlive the process: typed, sealed, tied to vehicle and configuration."""
