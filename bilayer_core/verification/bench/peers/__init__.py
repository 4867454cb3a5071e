"""Other programs on the common cantilever, each a module to run in a process of its own."""
