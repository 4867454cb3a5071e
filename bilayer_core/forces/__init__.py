"""One file for each physical term: formula, gradient, Hessian, the loop over its elements.

Terms know edges, nodes and bodies by their place in flat arrays; they do not know unknowns. Each kernel adds to the
accumulators of `bilayer_core.solve.workspace` and returns energies; the last argument says whether second derivatives
are wanted.
"""
