"""Runs made again from logs, and what the logs of runs will need."""
