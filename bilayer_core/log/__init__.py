"""Logs: their files (`file`), the messages in them (`messages`), and runs as quantities over time (`run`)."""
