"""Messages of a run: topics, schemas, encoders, markers, events."""
