"""Services and actions, ours and those of other packages."""
