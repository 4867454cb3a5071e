"""From a validated scene to flat read-only arrays."""
