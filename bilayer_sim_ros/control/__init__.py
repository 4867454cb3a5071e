"""Commands of controllers, and the time when they act."""
