"""The paper's Appendix A: a planar bilayer as one curve, the interface of its layers."""
