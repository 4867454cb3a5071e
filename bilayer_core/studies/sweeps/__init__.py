"""Many runs of one scene with other values: what is varied, how runs are spread over processes, and what is kept."""
