"""Steps in compiled loops: from one state to the next, or over many steps, without a return to the interpreter."""
