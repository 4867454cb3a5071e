"""Every case with a known answer: what `bilayer validate` computes. The tests take the same cases."""
