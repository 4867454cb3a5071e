"""What is seen of a run, and what acts on it from outside: what those exchange who make runs, record and show them."""
