"""What controllers ask for, and when it acts."""
