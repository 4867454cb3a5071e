"""Files of logs and bags: written, read, locked and repaired."""
