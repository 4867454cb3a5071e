"""What every node of this package is made of: parameters, arguments, signals, and the life of a run beside it."""
