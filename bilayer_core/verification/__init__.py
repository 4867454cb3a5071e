"""Evidence: cases with known answers, stress tests, benchmarks, and Appendix A's beam."""
