"""Common parts of the nodes of this package: parameters, arguments, signals, and the life of a run beside a node."""
