"""What a run says on topics, in files and to viewers."""
